"""What a long computation is doing: it says so here, and a screen asks.

Activities lie within each other: training, in it an iteration's rollout, and so on. The main thread
begins and ends them; others may advance them, and a screen may ask from its own.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Lock
from time import monotonic


@dataclass(eq=False)
class Activity:
    """One of the things that are being done."""

    name: str
    """For people: "collecting"."""
    done: float = 0.0
    """How many units of it are done."""
    total: float | None = None
    """How many there are, where that is known."""
    unit: str = ""
    """What they are, in the plural: "steps"."""
    begun: float = field(default_factory=monotonic)
    """When it began, by the clock of `monotonic`, s."""


_now: list[Activity] = []
_counting = Lock()


@contextmanager
def doing(name: str) -> Iterator[None]:
    """Say what is being done meanwhile."""
    own = Activity(name)
    _now.append(own)
    try:
        yield
    finally:
        _now.remove(own)


def progress(done: float, total: float | None, unit: str) -> None:
    """Say how much of the narrowest activity is done, of how much, and in what unit."""
    if _now:
        own = _now[-1]
        own.done, own.total, own.unit = done, total, unit


def advance() -> None:
    """Say that one more unit of the narrowest activity is done, from whatever thread."""
    if _now:
        with _counting:
            _now[-1].done += 1


def now() -> list[Activity]:
    """Return what is being done, the widest first."""
    return list(_now)
