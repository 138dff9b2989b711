"""How inner loops are compiled: two decorators, with strict and with fast arithmetic.

Kernels release the interpreter lock, so that threads can share the work. They are cached on disk,
and the cache knows when a file in a kernel's own folder changes but no other: a kernel uses only
what is in its folder, or is passed in.
"""

import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar, cast

import numba
from numba.core import event

from repaint_cli.process import cache_folder

_Function = TypeVar("_Function", bound=Callable[..., Any])

_FOLDER = os.environ.get("NUMBA_CACHE_DIR") or cache_folder("numba")
"""Where compiled kernels are kept; "" is nowhere."""

_compilations = event.TimingListener()  # type: ignore[no-untyped-call]
event.register("numba:compile", _compilations)  # type: ignore[no-untyped-call]


def training_clock() -> float:
    """Return the time of a clock that stands while kernels are compiled, s: that happens once."""
    return perf_counter() - (_compilations.duration if _compilations.done else 0.0)


def compiling() -> bool:
    """Return whether a kernel is being compiled at this moment, in whatever thread."""
    return bool(_compilations._depth)


def kernel(function: _Function) -> _Function:
    """Compile in strict floating point: numbers never depend on what else is in a batch."""
    return _compiled(function)


def fastmath_kernel(function: _Function) -> _Function:
    """Compile with sums in any order, and x / 0 = inf as in numpy, so that loops become vectors.

    Numbers that are not finite stay so: a caller may test for them.
    """
    flags = {"contract", "reassoc", "nsz", "arcp"}
    return _compiled(function, error_model="numpy", fastmath=flags)


def device_kernel(function: _Function) -> Any:
    """Compile for a GPU, at the first launch; what it calls may be a `kernel`.

    Such a module is imported only where a GPU is asked for: numba-cuda is an extra.
    """
    os.environ.setdefault("NUMBA_CUDA_LOW_OCCUPANCY_WARNINGS", "0")  # of a few cars
    from numba import cuda

    return cuda.jit(function)


def _compiled(function: _Function, **options: Any) -> _Function:
    """Compile for other threads to run beside, and keep the code in our folder."""
    config = vars(numba.config)
    before, config["CACHE_DIR"] = config["CACHE_DIR"], _FOLDER
    try:
        compiled = numba.njit(nogil=True, cache=bool(_FOLDER), **options)(function)
    finally:
        config["CACHE_DIR"] = before  # that of kernels that are not ours
    if (
        _FOLDER and not config["DISABLE_JIT"]
    ):  # numba's own stamp is that of the function's file alone
        folder = Path(function.__code__.co_filename).parent
        compiled._cache._cache_file._source_stamp = _stamp(folder)
    return cast(_Function, compiled)


@cache
def _stamp(folder: Path) -> tuple[tuple[str, int, int], ...]:
    """Return what tells whether a file of Python in a folder was changed: names, times, sizes."""
    files = sorted(folder.glob("*.py"))
    return tuple((file.name, file.stat().st_mtime_ns, file.stat().st_size) for file in files)
