"""How many threads work at once."""

import os
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController


def cores() -> int:
    """Return how many threads to use: OMP_NUM_THREADS where set, else one for each core of ours.

    Results of what asks do not depend on the number.
    """
    wanted = os.environ.get("OMP_NUM_THREADS", "")
    if wanted.isdecimal() and int(wanted):
        return int(wanted)
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on Linux
        return os.cpu_count() or 1


@cache
def blas() -> "ThreadpoolController":
    """Return a handle on the BLAS of numpy and of compiled code, to limit its threads."""
    import scipy.linalg.cython_blas  # noqa: F401  numba calls it; a library not yet loaded has no handle
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController().select(user_api="blas")
