"""How inner loops are compiled: two decorators, with strict and with fast arithmetic.

Kernels release the interpreter lock, so that threads can share the work. They are cached on disk,
and the cache knows when a kernel's own file changes but no other: a kernel uses only what is in
its file, or is passed in.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

_Function = TypeVar("_Function", bound=Callable[..., Any])


def kernel(function: _Function) -> _Function:
    """Compile in strict floating point: numbers never depend on what else is in a batch."""
    return cast(_Function, numba.njit(nogil=True, cache=True)(function))


def fastmath_kernel(function: _Function) -> _Function:
    """Compile with sums in any order, and x / 0 = inf as in numpy, so that loops become vectors.

    Numbers that are not finite stay so: a caller may test for them.
    """
    flags = {"contract", "reassoc", "nsz", "arcp"}
    compiled = numba.njit(nogil=True, cache=True, error_model="numpy", fastmath=flags)
    return cast(_Function, compiled(function))
