"""The tables of a page, as rows of texts: what was earned, when targets were reached, alarms."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from repaint_cli.runs.alarms import alarms_until
from repaint_cli.runs.comparison import Arrival, Comparison, arrival_of
from repaint_cli.runs.comparison_words import duration, interval, reduction, short, whole
from repaint_cli.runs.reader import RecordedRun

LEVELS = 8
"""Targets to choose from beside the one that was asked for, at most."""

Rows = list[list[str]]


def scores(comparison: Comparison) -> tuple[list[str], Rows]:
    """Return heads and rows of what each run earned."""
    heads = ["run", "seeds", "jump-start", "area", "best", "final"]
    rows = [
        [
            row.label, str(row.seeds), interval(row.first), interval(row.area), short(row.best),
            interval(row.final),
        ]
        for row in comparison.standings
    ]  # fmt: skip
    if _compares(comparison):
        heads.append("p")
        for cells, row in zip(rows, comparison.standings, strict=True):
            cells.append("-" if np.isnan(row.chance) else f"{row.chance:.2g}")
    return heads, rows


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
        rows = [arrival_of(label, run, basis, level) for label, run in runs.items()]
    return [_arrival(row, _compares(comparison)) for row in rows]


def _arrival(row: Arrival, compares: bool) -> list[str]:
    never = np.isnan(row.reached)
    saved = reduction((row.seconds_reduced, np.nan, np.nan))
    return [
        row.label,
        "never" if never else f"{row.reached:.0f}",
        *([reduction(row.reduced), saved] if compares else []),
        whole(row.env_steps),
        duration(row.seconds),
        ", ".join("never" if np.isnan(k) else f"{k:.0f}" for k in row.reached_each),
    ]


def _compares(comparison: Comparison) -> bool:
    return comparison.reference is not None and len(comparison.standings) > 1
