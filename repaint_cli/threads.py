"""How many threads work at once, and how those of torch wait.

A thread that waits by spinning keeps its core from the one it waits for: with another process on
the machine, a step of a microsecond then takes milliseconds.
"""

import os

WAITING = {"GOMP_SPINCOUNT": "2000"}
"""Environment variables to set before torch is imported: its threads sleep after waiting for some
ten microseconds, in place of ten milliseconds."""


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
