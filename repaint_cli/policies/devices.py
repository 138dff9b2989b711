"""Where networks act and learn: on the CPU, or on one NVIDIA GPU."""

import os
from dataclasses import fields, is_dataclass, replace
from typing import Any, Self

import torch
from torch import Tensor

from repaint_cli.errors import DeviceError, UsageError

HOST = torch.device("cpu")
"""Where the numbers of rollouts and samples lie; networks and large observations may not."""

NAMES = ("cpu", "cuda", "auto")
"""What can be asked for; "auto" is a GPU where one works, else the CPU."""


def device_named(name: str) -> str:
    """Return "cpu" or "cuda" for one of `NAMES`.

    Raises:
        UsageError: there is no such device.
        DeviceError: a GPU is asked for, and none works.
    """
    if name not in NAMES:
        raise UsageError(f"expected --device {', '.join(NAMES[:-1])} or auto, found '{name:.60}'")
    why = "" if name == "cpu" else why_no_gpu()
    if name == "cuda" and why:
        raise DeviceError(f"--device cuda: {why}; or leave it out, which learns on the CPU")
    return "cpu" if name == "cpu" or why else "cuda"


def why_no_gpu() -> str:
    """Return why no GPU works here, with what to do; "" where one does."""
    if torch.version.cuda is None:
        return (
            f"torch {torch.__version__} is built for the CPU alone; install a build with CUDA, "
            "see https://pytorch.org/get-started/locally"
        )
    try:
        torch.zeros(1, device="cuda")
    except (RuntimeError, AssertionError) as error:
        first = (str(error).strip().splitlines() or ["no reason given"])[0]
        return f"torch finds no GPU that works ({first:.160}); see what nvidia-smi says"
    return ""


def make_deterministic(device: str) -> None:
    """Let torch choose kernels on a GPU that add in the same order each time, in full float32."""
    if device == "cpu":
        return
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # read when cuBLAS begins
    torch.use_deterministic_algorithms(True)
    setattr(torch.utils.deterministic, "fill_uninitialized_memory", False)  # noqa: B010  # unread
    torch.backends.cudnn.benchmark = False
    torch.backends.cudnn.allow_tf32 = False
    torch.backends.cuda.matmul.allow_tf32 = False


class OnDevice:
    """A dataclass with tensors, which lie on one device together."""

    def to(self, device: torch.device) -> Self:
        """Return it with its tensors on a device: itself where they lie there."""
        assert is_dataclass(self)
        tensors = {field.name: getattr(self, field.name) for field in fields(self)}
        moved: dict[str, Any] = {
            name: tensor.to(device) for name, tensor in tensors.items()
            if isinstance(tensor, Tensor) and tensor.device != device
        }  # fmt: skip
        return replace(self, **moved) if moved else self
