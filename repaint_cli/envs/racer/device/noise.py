"""Noise of a GPU's lidars: normal numbers by key and place, without a state that threads share.

They are not those of the CPU, whose generators count in a row.
"""

import math
from typing import Any

import numpy as np

from repaint_cli.kernels import kernel

_STEP, _FIRST, _SECOND = (
    np.uint64(number) for number in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)
)
_ONE, _11, _27, _30, _31 = (np.uint64(number) for number in (1, 11, 27, 30, 31))
_UNIT = 2.0**-53


@kernel
def mixed(bits: Any) -> Any:
    """Return 64 bits that look random, of other 64 bits (splitmix64; Steele et al. 2014)."""
    bits += _STEP
    bits = (bits ^ (bits >> _30)) * _FIRST
    bits = (bits ^ (bits >> _27)) * _SECOND
    return bits ^ (bits >> _31)


@kernel
def normal(key: Any, place: int) -> float:
    """Return the standard normal number (Box and Muller 1958) at a place of a key's sequence.

    Args:
        key: 64 bits, of a car.
        place: which number, from 0.
    """
    first = mixed(np.uint64(key) ^ mixed(np.uint64(place)))
    second = mixed(first ^ _ONE)
    radius = math.sqrt(-2.0 * math.log((np.float64(first >> _11) + 0.5) * _UNIT))
    return radius * math.cos(2.0 * math.pi * np.float64(second >> _11) * _UNIT)
