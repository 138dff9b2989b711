"""Runs on one task against a reference: their numbers, and what so few seeds can show."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from repaint_cli.errors import NotFound, some
from repaint_cli.report import no_difference
from repaint_cli.report.arrivals import usual_targets
from repaint_cli.runs.comparison_rows import as_row, plain
from repaint_cli.runs.comparison_words import seeds_can_show
from repaint_cli.runs.reader import RecordedRun
from repaint_cli.runs.standings import Basis, Standing, standing_of

REFERENCE = "scratch"
"""The run that others are compared with where none is named; it may be absent."""

LEAST_SEEDS = 3
"""Of the reference, for what its seeds would be against each other."""


@dataclass(frozen=True)
class NoDifference:
    """What the paper's measure says of the reference against itself."""

    seeds: int
    """Of each of the two groups, drawn from the reference's."""
    never: float
    """In which share of the draws one of the two does not get there."""
    reduced: tuple[float, float, float]
    """1 − K / K_ref in the others: its mean, and between what 95 % of them lie; nan without any."""

    def as_json(self) -> dict[str, object]:
        """Return it as JSON."""
        mean, low, high = map(plain, self.reduced)
        named = {"reduced": mean, "reduced_low": low, "reduced_high": high}
        return {"seeds": self.seeds, "never": self.never} | named


@dataclass(frozen=True)
class Comparison:
    """All runs, the targets, and the run that they are compared with."""

    task: str
    target: float | None
    """Of the paper's measure: the highest that was given, or the reference's best mean."""
    given: tuple[float, ...]
    """The targets that were given, ascending; empty where they are shares of the reference's."""
    reference: str | None
    iterations: int
    """Iterations that all runs have, over which they are compared."""
    steps: tuple[float, float]
    """Environment steps that all seeds of all runs have."""
    standings: tuple[Standing, ...]
    no_difference: NoDifference | None

    def as_json(self) -> dict[str, object]:
        """Return all of it as JSON."""
        return {
            "task": self.task,
            "target": self.target,
            "reference": self.reference,
            "iterations": self.iterations,
            "steps": None if self.steps[0] >= self.steps[1] else list(self.steps),
            "warning": self.warning(),
            "what_seeds_can_show": seeds_can_show(self),
            "without_difference": self.no_difference and self.no_difference.as_json(),
            "runs": [as_row(standing, nested=True) for standing in self.standings],
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
        """The target of the paper's measure in words."""
        if self.target is None:
            return "none"
        of = "" if self.given else f", the best mean of {self.reference}"
        return f"{self.target:.4g}{of}"

    @property
    def basis(self) -> Standing | None:
        """The reference's own numbers."""
        return next((row for row in self.standings if row.label == self.reference), None)


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
    runs: Mapping[str, RecordedRun], reference: str | None, targets: Sequence[float] = ()
) -> Comparison:
    """Compare runs of one task with a reference, over the iterations that all of them have.

    Args:
        runs: by their labels.
        reference: the label of the run that others are compared with, or None.
        targets: the returns to reach. Where there are none, they are shares of the reference's
            converged score, and the paper's measure goes by its best mean.
    """
    common = min(run.returns.shape[1] for run in runs.values())
    whole = runs[reference] if reference else None
    part = whole.until(common) if whole is not None else None
    given = tuple(sorted(set(targets)))
    target = given[-1] if given else None
    wanted: dict[float, float | None] = dict.fromkeys(given)
    if part is not None and not given:
        target = float(np.nanmax(part.returns.mean(0)))
        wanted = {level: share for share, level in usual_targets(part.returns).items()}
    steps = _common_steps(list(runs.values()))
    basis = Basis(common, steps, whole, np.nan if target is None else target, wanted)
    return Comparison(
        task=next(iter(runs.values())).task.name, target=target, given=given, reference=reference,
        iterations=common, steps=steps,
        standings=tuple(standing_of(label, run, basis) for label, run in runs.items()),
        no_difference=None if part is None else _no_difference(part, given),
    )  # fmt: skip


def _common_steps(runs: Sequence[RecordedRun]) -> tuple[float, float]:
    """Return the environment steps that all seeds of all runs have."""
    steps = [run.rows["env_steps"] for run in runs]
    first = max(float(each[:, 0].max()) for each in steps)
    return first, min(float(each[:, -1].min()) for each in steps)


def _no_difference(reference: RecordedRun, given: Sequence[float]) -> NoDifference | None:
    """Return what the paper's measure says of groups of the reference's own seeds."""
    n = len(reference.returns)
    if n < LEAST_SEEDS:
        return None
    groups = no_difference.drawn(n, n)
    reduced = no_difference.reductions(reference.returns, groups, given[-1] if given else None)
    return NoDifference(n, no_difference.never(reduced), no_difference.middle_and_ends(reduced))
