"""How long a run would take, by its first iterations, trained in a temporary folder."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from repaint_cli.envs.output import prints_in_file
from repaint_cli.runs.experiment import Experiment
from repaint_cli.runs.new_folder import claimed
from repaint_cli.runs.plan import Plan

MOST_ITERATIONS = 3
"""The first takes longer than others, and a transfer has iterations of two kinds in turn."""
LONG_SECONDS = 20.0
"""After which no further iteration is begun."""
QUICK_SECONDS = 1.0
"""Iterations that take less than that are quick."""


@dataclass(frozen=True)
class Estimate:
    """How long a run would take."""

    measured: tuple[float, ...]
    """How long its first iterations took, s."""
    n_iterations: int
    """Of the run."""

    @property
    def seconds(self) -> float:
        """What all iterations would take: the first, and the mean of the next for each other."""
        return self.measured[0] + self.of_an_iteration * (self.n_iterations - 1)

    @property
    def of_an_iteration(self) -> float:
        """What an iteration but for the first takes: the mean of the next ones, s."""
        first, *others = self.measured
        return sum(others) / len(others) if others else first

    @property
    def quick(self) -> bool:
        """Whether an iteration takes less than a second."""
        return self.of_an_iteration < QUICK_SECONDS


def estimate(plan: Plan) -> Estimate:
    """Train a plan's first iterations in a temporary folder, and forget them.

    Raises:
        RepaintError: the run could not begin, or fails in these iterations.
    """
    seconds = list[float]()
    with _begun_elsewhere(plan) as experiment:
        began = before = perf_counter()
        reports = experiment.run()
        for _ in islice(reports, MOST_ITERATIONS):
            now = perf_counter()
            seconds.append(now - before)
            before = now
            if now - began > LONG_SECONDS:
                break
        reports.close()  # type: ignore[attr-defined]
    return Estimate(tuple(seconds), plan.task.ppo.n_iterations)


@contextmanager
def _begun_elsewhere(plan: Plan) -> Iterator[Experiment]:
    """Begin a run in a temporary folder, which does not outlast the block."""
    with TemporaryDirectory(prefix="repaint-") as folder, prints_in_file() as prints:
        place = replace(plan, folder=Path(folder) / "run", numbered=False)
        experiment = Experiment.prepare(place)
        with claimed(place.folder, experiment.write_first):
            prints.path = place.files.environment_log
            yield experiment
            prints.flush()
