"""How the racer compiles its inner loops: one decorator, one set of promises.

Kernels release the interpreter lock, so that threads can share the cars of a batch, and use strict
floating point: a car's numbers never depend on which other cars stand beside it. They are cached on
disk, and the cache knows when a kernel's own file changes but no other: a kernel uses only what
stands in its file, or is passed in.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

_Function = TypeVar("_Function", bound=Callable[..., Any])


def kernel(function: _Function) -> _Function:
    """Compile a function with numba; plain numbers and arrays in and out."""
    return cast(_Function, numba.njit(nogil=True, cache=True)(function))
