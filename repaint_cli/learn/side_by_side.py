"""Jobs that share nothing, on all cores: each has one thread, so that their number changes no bit.

Threads of torch's own split a convolution, wait for each other at its end, and sum in another order
when there are more of them. On a crowded machine all then wait for the one whose core is taken.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from threading import Event, local
from typing import TypeVar

import torch

from repaint_cli import interruption
from repaint_cli.threads import blas, cores

Result = TypeVar("Result")


@contextmanager
def one_thread() -> Iterator[None]:
    """Keep torch and BLAS to one thread meanwhile: further ones of both wait by spinning."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with blas().limit(limits=1):
            yield
    finally:
        torch.set_num_threads(before)


def side_by_side(jobs: Sequence[Callable[[], Result]]) -> list[Result]:
    """Do all jobs, as many at a time as there are cores; return what they return, in order.

    What a job raises is raised when all have ended, that of the first in order; that, and an
    interruption, end the others at their next `check`.
    """
    stop = Event()
    with ThreadPoolExecutor(cores(), initializer=_begin, initargs=(stop,)) as pool:
        running = [pool.submit(job) for job in jobs]
        try:
            return [job.result() for job in running]
        except BaseException:
            stop.set()
            raise


def check() -> None:
    """Raise what ends this thread's job early: to be asked after every step.

    Raises:
        KeyboardInterrupt: the main thread waits no longer for what it returns.
        Terminated: the process was asked to end.
    """
    interruption.check()
    if getattr(_own, "stop", None) and _own.stop.is_set():
        raise KeyboardInterrupt


_own = local()
"""What ends a thread's job early."""


def _begin(stop: Event) -> None:
    _own.stop = stop
    torch.set_num_threads(1)
