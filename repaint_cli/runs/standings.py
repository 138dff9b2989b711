"""One run's numbers beside a reference: what it earned, how far it is ahead, when it arrived."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from repaint_cli.report.arrivals import logrank_p, restricted, saved
from repaint_cli.report.pairs import Difference, better, difference
from repaint_cli.report.statistics import (
    Estimate,
    Floats,
    area_by_steps,
    area_under_curve,
    far_off,
    interquartile_mean_of,
    iteration_of_mean,
    iterations_to,
    mean_of,
)
from repaint_cli.runs.reader import RecordedRun


@dataclass(frozen=True)
class Arrival:
    """When one run reached a target by the paper's measure: that of its mean curve."""

    label: str
    reached: float
    """K, at which the mean curve is at the target; nan if never."""
    reached_each: tuple[float, ...]
    """The same of each seed."""
    reduced: float
    """1 − K / K of the reference; nan where one of the two never gets there."""
    env_steps: float
    """Environment steps a seed had taken at K, teachers' samples counted."""
    seconds: float
    """Wall-clock time at K, evaluations counted."""
    seconds_reduced: float
    """1 − seconds / seconds of the reference."""


@dataclass(frozen=True)
class SeedArrivals:
    """When the seeds of one run reached a target; those that did not are censored."""

    target: float
    """A return."""
    share: float | None
    """Which share of the reference's converged score that is; None where the target was given."""
    reached_each: tuple[float, ...]
    """K of each seed, nan if never."""
    k: Estimate
    """Restricted mean of K: of the iterations that were looked at, those that a seed needed."""
    earlier: Difference | None
    """How much earlier than the reference, in iterations; None for the reference itself."""
    p: float
    """Of the log-rank test against the reference, by permutation."""

    @property
    def arrived(self) -> int:
        """How many seeds reached it."""
        return int((~np.isnan(self.reached_each)).sum())


@dataclass(frozen=True)
class Against:
    """How far a run lies above the reference."""

    first: Difference
    area: Difference
    area_by_steps: Difference
    final: Difference
    """Of the last of the compared evaluations."""
    better: Estimate
    """P(X > Y): how probable it is that a seed has a larger area than one of the reference."""


@dataclass(frozen=True)
class Standing(Arrival):
    """How one run did over the iterations that all have."""

    method: str
    seeds: int
    iterations: int
    """Of the whole run."""
    first: Estimate
    """Mean return of the first evaluation: the jump-start."""
    area: Estimate
    """Mean return over iterations."""
    area_by_steps: Estimate
    """Mean return over the environment steps that all seeds of all runs have."""
    best: float
    """Highest point of the mean curve."""
    final: Estimate
    """Interquartile mean of the last of these evaluations, or the mean of fewer than 4 seeds."""
    final_each: tuple[float, ...]
    """That evaluation of each seed."""
    runaways: tuple[tuple[int, float, float], ...]
    """Seeds whose area lies far from the others': the seed, its area, and the median's."""
    targets: tuple[SeedArrivals, ...]
    """By target, ascending."""
    against: Against | None
    """Beside the reference; None for the reference itself, or where there is none."""


@dataclass(frozen=True)
class Basis:
    """What all runs of a comparison are compared over and with."""

    iterations: int
    """That all runs have."""
    steps: tuple[float, float]
    """Environment steps that all seeds of all runs have, from and to."""
    reference: RecordedRun | None
    """Whole."""
    target: float
    """Of the paper's measure; nan where there is none."""
    targets: Mapping[float, float | None]
    """Targets of seeds, ascending, and which share of the reference's converged score each is."""


def standing_of(label: str, run: RecordedRun, basis: Basis) -> Standing:
    """Return the numbers of a run."""
    part, other = run.until(basis.iterations), basis.reference
    reference = None if other is None else other.until(basis.iterations)
    own = _numbers(run, basis)
    against = None
    if other is not None and run is not other:
        others = _numbers(other, basis)
        gaps = {name: difference(own[name], others[name], run.seeds, other.seeds) for name in own}
        against = Against(**gaps, better=better(own["area"], others["area"]))
    alone = run is other
    return Standing(
        **vars(arrival_of(label, part, None if alone else reference, basis.target)),
        method=run.method, seeds=len(run.returns), iterations=run.returns.shape[1],
        first=mean_of(own["first"]), area=mean_of(own["area"]),
        area_by_steps=mean_of(own["area_by_steps"]), best=float(np.nanmax(part.returns.mean(0))),
        final=interquartile_mean_of(own["final"]), final_each=tuple(own["final"]),
        runaways=runaways(run.seeds, own["area"]),
        targets=tuple(
            seeds_to(part, None if alone else reference, target, share)
            for target, share in basis.targets.items()
        ),
        against=against,
    )  # fmt: skip


def runaways(seeds: Sequence[int], areas: Floats) -> tuple[tuple[int, float, float], ...]:
    """Return the seeds whose area (S,) lies far from the others', with it and the median's."""
    middle = float(np.median(areas))
    pairs = zip(seeds, areas.tolist(), far_off(areas), strict=True)
    return tuple((seed, area, middle) for seed, area, far in pairs if far)


def _numbers(run: RecordedRun, basis: Basis) -> dict[str, Floats]:
    """Return what runs are compared by, a number a seed."""
    part = run.until(basis.iterations)
    return {
        "first": part.returns[:, 0],
        "area": area_under_curve(part.returns),
        "area_by_steps": area_by_steps(run.returns, run.rows["env_steps"], *basis.steps),
        "final": part.returns[:, -1],
    }


def arrival_of(
    label: str, run: RecordedRun, reference: RecordedRun | None, target: float
) -> Arrival:
    """Return when a run's mean curve reached a target, beside the reference if there is one."""
    reached = iteration_of_mean(run.returns, target)
    seconds = _at(run, "seconds", reached)
    reduced = seconds_reduced = np.nan
    if reference is not None:
        reduced = saved(run.returns, reference.returns, target)
        needed = _at(reference, "seconds", iteration_of_mean(reference.returns, target))
        seconds_reduced = 1 - seconds / needed
    return Arrival(
        label=label, reached=reached, reached_each=tuple(iterations_to(run.returns, target)),
        reduced=reduced, env_steps=_at(run, "env_steps", reached), seconds=seconds,
        seconds_reduced=seconds_reduced,
    )  # fmt: skip


def seeds_to(
    run: RecordedRun, reference: RecordedRun | None, target: float, share: float | None = None
) -> SeedArrivals:
    """Return when a run's seeds reached a target, beside the reference if there is one."""
    horizon, reached = run.returns.shape[1], iterations_to(run.returns, target)
    earlier, p = None, np.nan
    if reference is not None:
        others = iterations_to(reference.returns, target)
        # a smaller K is a gain: the difference of minus K
        earlier = difference(
            -restricted(reached, horizon), -restricted(others, horizon), run.seeds, reference.seeds
        )
        p = logrank_p(reached, others)
    k = mean_of(restricted(reached, horizon))
    return SeedArrivals(target, share, tuple(reached), k, earlier, p)


def _at(run: RecordedRun, name: str, k: float) -> float:
    """Return a column's mean over seeds at iteration k, nan if k is."""
    return float("nan") if np.isnan(k) else float(run.rows[name][:, int(k) - 1].mean())
