"""Runs on one task against a reference: the numbers of the paper's tables 1 and 6, per run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from repaint_cli.errors import NotFound, some
from repaint_cli.report.statistics import (
    area_under_curve,
    differ_by_chance,
    iqm_ci,
    iteration_of_mean,
    iterations_to,
    mean_ci,
    reduction_ci,
)
from repaint_cli.runs.reader import RecordedRun

REFERENCE = "scratch"
"""The run that others are compared with where none is named; it may be absent."""

Estimate = tuple[float, float, float]
"""A number and the ends of its 95 % bootstrap interval over seeds, nan where there is none."""


@dataclass(frozen=True)
class Arrival:
    """When one run reached a target."""

    label: str
    reached: float
    """K, at which the mean curve is at the target; nan if never."""
    reached_each: tuple[float, ...]
    """The same of each seed."""
    reduced: Estimate
    """1 − K / K of the reference."""
    env_steps: float
    """Environment steps a seed had taken at K, teachers' samples counted."""
    seconds: float
    """Wall-clock time at K, evaluations counted."""
    seconds_reduced: float
    """1 − seconds / seconds of the reference."""


@dataclass(frozen=True)
class Standing(Arrival):
    """How one run did over the iterations that all have, and when it reached the target."""

    method: str
    seeds: int
    iterations: int
    """Of the whole run."""
    first: Estimate
    """Mean return of the first evaluation: the jump-start."""
    area: Estimate
    """Mean return."""
    best: float
    """Highest point of the mean curve."""
    final: Estimate
    """Interquartile mean of the last of these evaluations."""
    chance: float
    """p of the area's difference from the reference's, by permutation of seeds."""


@dataclass(frozen=True)
class Comparison:
    """All runs, the target, and the run that they are compared with."""

    task: str
    target: float | None
    reference: str | None
    given: bool
    """Whether the target was given, and not taken from the reference."""
    iterations: int
    """Iterations that all runs have, over which they are compared."""
    standings: tuple[Standing, ...]

    def as_json(self) -> dict[str, object]:
        """Return all of it as JSON."""
        return {
            "task": self.task,
            "target": self.target,
            "reference": self.reference,
            "iterations": self.iterations,
            "warning": self.warning(),
            "runs": [as_row(standing) for standing in self.standings],
        }

    def warning(self, names: Mapping[str, str] | None = None) -> str | None:
        """Say which runs are shorter than others; None where all are as long.

        `names` are what to call runs, by their labels; those where absent.
        """
        longest = max(row.iterations for row in self.standings)
        if longest == self.iterations:
            return None
        labels = [row.label for row in self.standings if row.iterations == self.iterations]
        short = [names[label] for label in labels] if names else labels
        verb, parts = "has" if len(short) == 1 else "have", f"{self.iterations} of {longest}"
        return (
            f"{some(short, between=' and ')} {verb} only {parts} iterations: all runs are compared "
            f"over the first {self.iterations}"
        )

    @property
    def goal(self) -> str:
        """The target in words."""
        if self.target is None:
            return "none"
        of = "" if self.given else f", the best mean of {self.reference}"
        return f"{self.target:.4g}{of}"


def reference_of(runs: Mapping[str, RecordedRun], wanted: str) -> str | None:
    """Return the label of the reference: a label, a run's folder, or the first run of a method.

    Raises:
        NotFound: no run has such a name, and it is not `REFERENCE`.
    """
    if wanted in runs:
        return wanted
    called = {label: (run.method, str(run.folder).rstrip("/")) for label, run in runs.items()}
    named = next((label for label, names in called.items() if wanted.rstrip("/") in names), None)
    if named is None and wanted != REFERENCE:
        raise NotFound.named("reference", wanted, runs, "repaint compare --help")
    return named


def comparison_of(
    runs: Mapping[str, RecordedRun], reference: str | None, target: float | None
) -> Comparison:
    """Compare runs of one task with a reference, over the iterations that all of them have.

    Args:
        runs: by their labels.
        reference: the label of the run that others are compared with, or None.
        target: the score to reach; the reference's best mean where absent, as in the paper.
    """
    lengths = {label: run.returns.shape[1] for label, run in runs.items()}
    common = min(lengths.values())
    parts = {label: run.until(common) for label, run in runs.items()}
    basis, given = parts[reference] if reference else None, target is not None
    if target is None and basis is not None:
        target = float(np.nanmax(basis.returns.mean(0)))
    standings = [
        _standing(label, part, basis, target, lengths[label]) for label, part in parts.items()
    ]
    task = next(iter(runs.values())).task.name
    return Comparison(task, target, reference, given, common, tuple(standings))


def _standing(
    label: str, run: RecordedRun, basis: RecordedRun | None, target: float | None, length: int
) -> Standing:
    returns, chance = run.returns, np.nan
    areas = area_under_curve(returns)
    if basis is not None and basis is not run:
        chance = differ_by_chance(areas, area_under_curve(basis.returns))
    return Standing(
        **vars(arrival_of(label, run, basis, np.nan if target is None else target)),
        method=run.method, seeds=len(returns), iterations=length,
        first=mean_ci(returns[:, 0]), area=mean_ci(areas), best=float(np.nanmax(returns.mean(0))),
        final=iqm_ci(returns[:, -1]), chance=chance,
    )  # fmt: skip


def arrival_of(label: str, run: RecordedRun, basis: RecordedRun | None, target: float) -> Arrival:
    """Return when a run reached a target, beside the reference if there is another one."""
    reached = iteration_of_mean(run.returns, target)
    seconds = _at(run, "seconds", reached)
    reduced: Estimate = (np.nan, np.nan, np.nan)
    seconds_reduced = np.nan
    if basis is not None and basis is not run:
        reduced = reduction_ci(run.returns, basis.returns, target)
        needed = _at(basis, "seconds", iteration_of_mean(basis.returns, target))
        seconds_reduced = 1 - seconds / needed
    return Arrival(
        label=label, reached=reached, reached_each=tuple(iterations_to(run.returns, target)),
        reduced=reduced, env_steps=_at(run, "env_steps", reached), seconds=seconds,
        seconds_reduced=seconds_reduced,
    )  # fmt: skip


def _at(run: RecordedRun, name: str, k: float) -> float:
    """Return a column's mean over seeds at iteration k, nan if k is."""
    return float("nan") if np.isnan(k) else float(run.rows[name][:, int(k) - 1].mean())


COLUMNS = (
    "run", "method", "seeds", "iterations", "k", "reduced", "reduced_low", "reduced_high",
    "env_steps", "seconds", "seconds_reduced", "first", "first_low", "first_high", "area",
    "area_low", "area_high", "best", "final_iqm", "final_low", "final_high", "p", "k_each",
)  # fmt: skip
"""Of comparison.csv."""


def as_row(standing: Standing) -> dict[str, object]:
    """Return a run's numbers by the names in `COLUMNS`; None where there is none."""
    values: Sequence[object] = (
        standing.label, standing.method, standing.seeds, standing.iterations, standing.reached,
        *standing.reduced, standing.env_steps, standing.seconds, standing.seconds_reduced,
        *standing.first, *standing.area, standing.best, *standing.final, standing.chance,
        [_plain(k) for k in standing.reached_each],
    )  # fmt: skip
    return {name: _plain(value) for name, value in zip(COLUMNS, values, strict=True)}


def _plain(value: object) -> object:
    """Return a float as JSON knows it: None for nan, a whole number without a point."""
    if not isinstance(value, float | np.floating):
        return value
    number = float(value)
    if np.isnan(number):
        return None
    return int(number) if number.is_integer() else number
