"""How inner loops are compiled: two decorators, with strict and with fast arithmetic.

Kernels release the interpreter lock, so that threads can share the work. They are cached on disk,
and the cache knows when a kernel's own file changes but no other: a kernel uses only what is in
its file, or is passed in.
"""

import os
from collections.abc import Callable
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


def _compiled(function: _Function, **options: Any) -> _Function:
    """Compile for other threads to run beside, and keep the code in our folder."""
    config = vars(numba.config)
    before, config["CACHE_DIR"] = config["CACHE_DIR"], _FOLDER
    try:
        return cast(_Function, numba.njit(nogil=True, cache=bool(_FOLDER), **options)(function))
    finally:
        config["CACHE_DIR"] = before  # that of kernels that are not ours
