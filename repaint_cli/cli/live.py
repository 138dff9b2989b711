"""A sign of life on a terminal: what is being done, how far it is, and how long the rest takes."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from textwrap import indent
from time import monotonic

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from repaint_cli import activity
from repaint_cli.activity import Activity
from repaint_cli.cli.console import plain
from repaint_cli.runs.comparison_words import duration

NAME_WIDTH, BAR_WIDTH, COUNT_WIDTH = 24, 10, 20


@contextmanager
def live(
    console: Console,
    left: Callable[[], float | None] = lambda: None,
    note: Callable[[], str] = lambda: "",
    compiling: Callable[[], bool] = lambda: False,
) -> Iterator[None]:
    """Show meanwhile what is being done, if the console is a terminal.

    Args:
        console: on which.
        left: how many seconds the iterations that are left take, if that is known.
        note: a line beneath, or several.
        compiling: whether code is being compiled, which holds up what is being done.
    """
    waiting = [Activity("starting")]

    def render() -> RenderableType:
        if now := activity.now():
            waiting.clear()  # nothing after the last activity
        rows = Table.grid(padding=(0, 1))
        for width in (NAME_WIDTH, BAR_WIDTH, COUNT_WIDTH, None):
            rows.add_column(width=width, no_wrap=True, overflow="ellipsis")
        shown = now or waiting
        for depth, own in enumerate(shown):
            time = "" if depth else _time(own, left() if own.unit == "iterations" else None)
            held_up = ", compiling" if own is shown[-1] and compiling() else ""
            name = Text("  " * depth + plain(own.name) + held_up)
            rows.add_row(name, _bar(own), Text(_count(own)), Text(time))
        beneath = note() if now else ""
        return Group(rows, Text(indent(beneath, "  "))) if beneath else rows

    if not console.is_terminal:
        yield
        return
    with Live(get_renderable=render, console=console, refresh_per_second=4, transient=True):
        yield


@contextmanager
def loading(console: Console) -> Iterator[None]:
    """Show that libraries are being imported meanwhile, which takes seconds."""
    with live(console), activity.doing("loading libraries"):
        yield


def _bar(own: Activity) -> ProgressBar:
    pulse = own.total is None
    return ProgressBar(own.total or 1, own.done, BAR_WIDTH, pulse=pulse, animation_time=monotonic())


def _count(own: Activity) -> str:
    if not own.unit:
        return ""
    of = "" if own.total is None else f"/{own.total:,.0f}"
    return f"{own.done:,.0f}{of} {own.unit}"


def _time(own: Activity, left: float | None) -> str:
    minutes, seconds = divmod(int(monotonic() - own.begun), 60)
    hours, minutes = divmod(minutes, 60)
    so_far = f"{hours}:{minutes:02}:{seconds:02}" if hours else f"{minutes}:{seconds:02}"
    return so_far + ("" if left is None else f", {duration(left)} left")


class Pace:
    """How long iterations take, and so how long those that are left will."""

    NEWEST = 5
    """How many of the last iterations count."""
    LONG = 10.0
    """A first iteration of so many seconds counts, too; in a shorter one most is warming up."""

    def __init__(self, clock: Callable[[], float]) -> None:
        """Begin to measure, by a clock that may stand while code is compiled, s."""
        self._clock = clock
        self.begin()

    def begin(self) -> None:
        """Begin to measure; what was measured before does not count."""
        self._seconds: list[float] = []
        self._since = self._clock()

    def add(self) -> None:
        """An iteration has ended."""
        now = self._clock()
        self._seconds.append(now - self._since)
        self._since = now

    def iteration(self) -> float | None:
        """Return how long an iteration takes, s; None while that is not known."""
        if len(self._seconds) == 1:
            return self._seconds[0] if self._seconds[0] >= self.LONG else None
        newest = self._seconds[1:][-self.NEWEST :]
        return sum(newest) / len(newest) if newest else None

    def left(self, iterations: int) -> float | None:
        """Return how long so many more iterations take from now on, s."""
        one = self.iteration()
        return None if one is None else max(0.0, one * iterations - (self._clock() - self._since))
