"""How many threads work at once."""

import os


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
