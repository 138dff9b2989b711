"""Where networks act and learn: on the CPU, or on one NVIDIA GPU."""

import os

import torch

from repaint_cli.errors import DeviceError, UsageError

NAMES = ("cpu", "cuda", "auto")
"""What can be asked for; "auto" is a GPU where one works, else the CPU."""


def device_named(name: str) -> str:
    """Return "cpu" or "cuda" for one of `NAMES`; a GPU is told to give the same numbers each time.

    Raises:
        UsageError: there is no such device.
        DeviceError: a GPU is asked for, and none works.
    """
    if name not in NAMES:
        raise UsageError(f"expected --device {', '.join(NAMES[:-1])} or auto, found '{name:.60}'")
    why = "" if name == "cpu" else why_no_gpu()
    if name == "cuda" and why:
        raise DeviceError(f"--device cuda: {why}; or leave it out, which learns on the CPU")
    if name == "cpu" or why:
        return "cpu"
    _give_same_numbers()
    return "cuda"


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


def _give_same_numbers() -> None:
    """Let torch choose kernels that add in the same order each time, in full float32."""
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # read when cuBLAS begins
    torch.use_deterministic_algorithms(True)
    setattr(torch.utils.deterministic, "fill_uninitialized_memory", False)  # noqa: B010  # unread
    torch.backends.cudnn.benchmark = False
    torch.backends.cudnn.allow_tf32 = False
    torch.backends.cuda.matmul.allow_tf32 = False
