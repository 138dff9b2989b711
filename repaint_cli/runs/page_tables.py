"""The tables of a page, as rows of texts: what was earned, when targets were reached, alarms."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from repaint_cli.runs.alarms import alarms_until
from repaint_cli.runs.comparison import Comparison
from repaint_cli.runs.comparison_words import (
    chance,
    duration,
    interval,
    needed,
    reduction,
    seeds_k,
    short,
    target_name,
    whole,
)
from repaint_cli.runs.reader import RecordedRun
from repaint_cli.runs.standings import Against, Arrival, SeedArrivals, arrival_of

LEVELS = 8
"""Targets to choose from beside the one that was asked for, at most."""

Rows = list[list[str]]


def scores(comparison: Comparison) -> tuple[list[str], Rows]:
    """Return heads and rows of what each run earned."""
    heads = ["run", "seeds", "jump-start", "area", "area by steps", "best", "final"]
    rows = [
        [
            row.label, str(row.seeds), interval(row.first), interval(row.area),
            interval(row.area_by_steps), short(row.best), interval(row.final),
        ]
        for row in comparison.standings
    ]  # fmt: skip
    return heads, rows


def differences(comparison: Comparison) -> tuple[list[str], Rows]:
    """Return heads and rows of how far runs lie above the reference; no rows without one."""
    heads = [
        "run", "difference in area", "p", "P(X > Y)", "seeds needed", "pairs", "by steps", "first",
        "final",
    ]  # fmt: skip
    named = [(row.label, row.against) for row in comparison.standings if row.against]
    return heads, [[label, *_difference(against)] for label, against in named]


def _difference(against: Against) -> list[str]:
    area = against.area
    return [
        interval(area.mean), chance(area.p), interval(against.better), needed(area.seeds_needed),
        str(area.pairs or "none"),
        *(interval(gap.mean) for gap in (against.area_by_steps, against.first, against.final)),
    ]  # fmt: skip


def ladder(comparison: Comparison) -> tuple[list[str], Rows, Rows]:
    """Return heads and rows of when seeds reached the targets, and of how much earlier."""
    first, *_ = comparison.standings
    heads = ["run", *map(target_name, first.targets)]
    reached = [[row.label, *map(_seeds, row.targets)] for row in comparison.standings]
    earlier = [
        [row.label, *map(_earlier, row.targets)] for row in comparison.standings if row.against
    ]
    return heads, reached, earlier


def _seeds(arrivals: SeedArrivals) -> str:
    ends = "" if arrivals.arrived == 0 else interval(arrivals.k).partition(" ")[2]
    return f"{seeds_k(arrivals)} {ends}".strip()


def _earlier(arrivals: SeedArrivals) -> str:
    if arrivals.earlier is None or np.isnan(arrivals.p):
        return "-"
    return f"{interval(arrivals.earlier.mean)}, p = {chance(arrivals.p)}"


def targets(runs: Mapping[str, RecordedRun], comparison: Comparison) -> dict[str, Any]:
    """Return when each run reached some targets, and which of them is shown first.

    They are the comparison's own and round returns between the lowest beginning and the best end.
    """
    runs = {label: run.until(comparison.iterations) for label, run in runs.items()}
    levels = _levels(runs, comparison)
    wanted = levels[-1] if comparison.target is None else comparison.target
    named = {
        level: comparison.goal if level == comparison.target else short(level) for level in levels
    }
    reduced = ["K reduced", "time reduced"] if _compares(comparison) else []
    return {
        "heads": ["run", "K", *reduced, "steps", "time", "each seed's K"],
        "levels": levels,
        "choices": [
            {"name": name, "rows": _arrivals(runs, comparison, level)}
            for level, name in named.items()
        ],
        "chosen": levels.index(wanted),
    }


def alarms(runs: Mapping[str, RecordedRun]) -> tuple[list[str], Rows]:
    """Return heads and rows of what looked wrong, run by run.

    Raises:
        CheckpointError: a file of alarms is damaged.
    """
    rows = []
    for label, run in runs.items():
        for alarm in alarms_until(run.returns.shape[1], run.files, run.record):
            what = alarm.text.removeprefix(f"iteration {alarm.iteration}: ")
            rows.append([label, str(alarm.iteration), alarm.kind, what])
    heads = ["run", "iteration", "kind", "what"]
    return (heads, rows) if len(runs) > 1 else (heads[1:], [row[1:] for row in rows])


def _levels(runs: Mapping[str, RecordedRun], comparison: Comparison) -> list[float]:
    low = min(float(run.returns[:, 0].mean()) for run in runs.values())
    high = max(standing.best for standing in comparison.standings)
    ticks = MaxNLocator(LEVELS, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
    levels = {float(tick) for tick in ticks if low < tick <= high}
    if comparison.target is not None:
        levels.add(comparison.target)
    return sorted(levels or {high})


def _arrivals(
    runs: Mapping[str, RecordedRun], comparison: Comparison, level: float
) -> list[list[str]]:
    if level == comparison.target:
        rows: Sequence[Arrival] = comparison.standings
    else:
        basis = runs[comparison.reference] if comparison.reference else None
        rows = [
            arrival_of(label, run, None if run is basis else basis, level)
            for label, run in runs.items()
        ]
    return [_arrival(row, _compares(comparison)) for row in rows]


def _arrival(row: Arrival, compares: bool) -> list[str]:
    never = np.isnan(row.reached)
    return [
        row.label,
        "never" if never else f"{row.reached:.0f}",
        *([reduction(row.reduced), reduction(row.seconds_reduced)] if compares else []),
        whole(row.env_steps),
        duration(row.seconds),
        ", ".join("never" if np.isnan(k) else f"{k:.0f}" for k in row.reached_each),
    ]


def _compares(comparison: Comparison) -> bool:
    return comparison.reference is not None and len(comparison.standings) > 1
