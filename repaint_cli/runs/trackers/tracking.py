"""Keep trackers up with a run. What happens to them is a line, and never the run's affair."""

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import groupby
from types import TracebackType
from typing import Any

from repaint_cli import interruption
from repaint_cli.envs.output import Output, captured, output_to, warn
from repaint_cli.files.limits import read_rows
from repaint_cli.runs.folder import RunFolder
from repaint_cli.runs.metrics import COLUMNS, Report
from repaint_cli.runs.trackers.tracker import (
    TRACKERS,
    TrackedRun,
    Tracker,
    is_installed,
    tracker_class,
)

NO_NUMBERS = ("iteration", "seed", "phase")
"""Columns of metrics.csv that are no curves."""


class Tracking:
    """Trackers of a run while it trains; a context manager.

    A tracker that fails is left out from then on. What it lacks, from metrics.csv, it gets when
    the run is resumed, as it gets the iterations of a run that began without it.
    """

    def __init__(self, names: Sequence[str], run: TrackedRun, k: int) -> None:
        """Name the trackers.

        Args:
            names: of them, in `TRACKERS`.
            run: that they track.
            k: how many iterations are done.
        """
        self._run, self._k = run, k
        self._trackers = [tracker_class(name)(run) for name in dict.fromkeys(names)]

    def __enter__(self) -> "Tracking":
        """Open the trackers, and give them the iterations that are done."""
        for tracker in list(self._trackers):
            with self._without_harm(tracker):
                last = tracker.open()
                for k, numbers, when in self._done() if last < self._k else ():
                    if last < k <= self._k:
                        tracker.write(k, numbers, when)
                tracker.caught_up()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for tracker in list(self._trackers):
            with self._without_harm(tracker):
                tracker.close(kind is None)

    def add(self, report: Report) -> None:
        """Write an iteration's numbers."""
        rows = zip(self._run.seeds, map(_numbers, report.rows), strict=True)
        numbers, now = dict(rows), time.time()
        for tracker in list(self._trackers):
            with self._without_harm(tracker):
                tracker.write(report.stats.iteration, numbers, now)

    def _done(self) -> Iterator[tuple[int, dict[int, dict[str, float]], float]]:
        """Yield the iterations in metrics.csv, their numbers by seed, and when they ended."""
        path = self._run.files.metrics
        rows = list(read_rows(path, COLUMNS, appended=True))
        began = path.stat().st_mtime - float(rows[-1]["seconds"])
        for k, same in groupby(rows, lambda row: int(row["iteration"])):
            seeds = list(same)
            when = began + float(seeds[0]["seconds"])
            yield k, {int(row["seed"]): _numbers(row) for row in seeds}, when

    @contextmanager
    def _without_harm(self, tracker: Tracker) -> Iterator[None]:
        """Run a tracker, which is other people's code: quietly, and whatever it raises."""
        try:
            with output_to(_Nowhere()), captured():
                yield
        except Exception as error:  # of any kind
            self._trackers.remove(tracker)
            reason = (str(error).strip() or type(error).__name__).splitlines()[0]
            warn(f"the run goes on without {tracker.title}: {reason:.300}")
        finally:
            interruption.check()  # which the tracker may have swallowed


class _Nowhere(Output):
    """Drops what trackers print."""

    def prints(self, text: str) -> None:
        """Drop it."""

    def warns(self, text: str) -> None:
        """Drop it."""


def _numbers(row: Mapping[str, Any]) -> dict[str, float]:
    """Return the numbers of a row of metrics.csv."""
    numbers = {n: float(x) for n, x in row.items() if n not in NO_NUMBERS and x != ""}
    return {name: number for name, number in numbers.items() if not math.isnan(number)}


def trackers_of(files: RunFolder, names: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the trackers of a run, and notices of those that are not installed any more.

    Args:
        files: of the run; one that was tracked before still is.
        names: of the trackers that are asked for.
    """
    before = [name for name in TRACKERS if tracker_class(name).place(files).exists()]
    absent = [name for name in before if not is_installed(name)]
    notices = [
        f"{tracker_class(name).title} is not installed: its curves go on when the run is resumed "
        "with it"
        for name in absent
    ]
    wanted = dict.fromkeys([*names, *(name for name in before if name not in absent)])
    return list(wanted), notices
