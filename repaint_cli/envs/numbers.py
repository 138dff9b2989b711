"""Numbers among what environments of other people report."""

from collections.abc import Mapping
from typing import Any

import numpy as np

QUICK = (float, np.float64, int, bool)
"""What nearly all numbers are."""


def number_of(value: Any) -> float | None:
    """Return a number, or the one number of an array or a list, as a float; None of all else."""
    if type(value) in QUICK:
        return float(value)
    if isinstance(value, int | np.generic | np.ndarray | list | tuple) or hasattr(
        value, "__array__"
    ):
        try:
            array = np.asarray(value)
        except Exception:  # lists of unequal lengths, arrays of other libraries
            return None
        if array.size == 1 and array.dtype.kind in "fiub":
            return float(array.item())
    return None


def describe(value: Any) -> str:
    """Return what a value is that should be a number, for people."""
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}" + (" of objects" if value.dtype == object else "")
    if isinstance(value, str):
        return f"the text '{value:.40}'"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}"
    if isinstance(value, Mapping):
        return f"a table of {', '.join(map(str, value)) or 'nothing'}"
    return "None" if value is None else f"a {type(value).__name__}"
