"""In which precision networks that read images compute: float32, or bfloat16 where it is fast.

Weights, their gradients' buffer, Adam, losses, and the layers behind the large dense one are always
float32; in bf16 all convolutions but the first, and that layer, read weights and activations
rounded to bfloat16: the gradient of a first convolution's weights is slower in it.
"""

from collections.abc import Mapping

import torch

from repaint_cli.errors import some
from repaint_cli.policies.architecture import NetConfig


def is_native() -> bool:
    """Return whether this CPU has instructions for products of bfloat16, AVX-512's or AMX.

    Torch computes in bfloat16 on any CPU, but with others it converts at every step.
    """
    asked = ("_is_avx512_bf16_supported", "_is_amx_tile_supported")  # not in every torch
    return any(getattr(torch.cpu, name)() for name in asked if hasattr(torch.cpu, name))


def resolved(net: NetConfig) -> NetConfig:
    """Return the networks with `auto` replaced by what it means on this CPU."""
    if net.precision != "auto":
        return net
    fast = net.kind == "cnn" and is_native()
    return net.model_copy(update={"precision": "bf16" if fast else "float32"})


def slowness_warnings(net: NetConfig, teachers: Mapping[str, NetConfig], begun: bool) -> list[str]:
    """Return a sentence for networks in a precision that this CPU has no instructions for.

    Args:
        net: a run's own networks.
        teachers: its teachers', by their names.
        begun: whether the run has begun, and keeps its settings.
    """
    names = [name for name, other in teachers.items() if other.precision == "bf16"]
    if is_native() or not (names or net.precision == "bf16"):
        return []
    slowly = "in bf16, which this CPU has no instructions for: that works, but is slow"
    way = "the run keeps it as it began" if begun else "try --set net.precision=float32"
    own = [f"the networks compute {slowly}; {way}"] if net.precision == "bf16" else []
    return own + ([f"the networks of {some(names)} compute {slowly}"] if names else [])
