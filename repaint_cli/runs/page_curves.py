"""The learning curves of a page, as JSON: what its script draws.

**S** seeds · **K** iterations · **P** points that are drawn.
"""

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from repaint_cli.report import style
from repaint_cli.report.statistics import t_interval
from repaint_cli.runs.reader import RecordedRun

MOST_POINTS = 400
"""Of a curve; of longer ones some iterations are left out."""

LEAST_SEEDS = 3
"""For an interval, as in the figures."""

DASHES = 4
"""Kinds of dashes that tell runs of one colour apart."""

ACROSS = {"iteration": "iterations", "env_steps": "environment steps", "seconds": "time"}
"""What a curve may go over."""

UP = {
    "return": ("eval_return", "return", "mean evaluation return"),
    "progress": ("eval_progress", "lap progress", "mean lap progress [%]"),
    "beta": ("kickstart_coef", "β", "β, weight of the pull to the teacher"),
    "kept": ("kept_fraction", "kept share", "share of teacher samples kept"),
}
"""What a curve may show: the column of metrics.csv, the name of the choice, that of the axis."""


def curves_json(runs: Mapping[str, RecordedRun], targets: list[float]) -> dict[str, Any]:
    """Return the curves of some runs, and the targets that may be chosen."""
    colours, used = style.colours_of(runs), Counter[str]()
    curves = []
    for label, run in runs.items():
        colour = colours[label]
        curves.append(_curve(label, run, colour, used[colour] % DASHES))
        used[colour] += 1
    shown = [name for name in UP if any(name in curve["up"] for curve in curves)]
    return {
        "runs": curves,
        "targets": [_number(target) for target in targets],
        "acrosses": ACROSS,
        "ups": {name: UP[name][1] for name in shown},
        "axes": {name: UP[name][2] for name in shown},
    }


def note_of(runs: Mapping[str, RecordedRun]) -> str:
    """Say what the lines are."""
    seeds = [len(run.seeds) for run in runs.values()]
    parts = ["bold: the mean over seeds; thin: each seed" if max(seeds) > 1 else "one seed a line"]
    if max(seeds) >= LEAST_SEEDS:
        parts.append("shaded: 95 % interval of the mean")
    if any(run.taught_until for run in runs.values()):
        parts.append("ring: the last iteration with a teacher")
    longest = max(run.returns.shape[1] for run in runs.values())
    if longest > MOST_POINTS:
        parts.append(f"of {longest:,} iterations {MOST_POINTS} are drawn")
    return "; ".join(parts).capitalize() + "."


def _curve(label: str, run: RecordedRun, colour: str, dash: int) -> dict[str, Any]:
    n = run.returns.shape[1]
    points = np.unique(np.linspace(0, n - 1, min(n, MOST_POINTS)).round().astype(int))
    taught = run.taught_until - 1
    if taught >= 0:
        points = np.union1d(points, [taught])
    return {
        "label": label, "light": colour, "dark": style.ON_DARK.get(colour, colour), "dash": dash,
        "taught": int(np.searchsorted(points, taught)) if taught >= 0 else -1,
        "across": {
            "iteration": (points + 1).tolist(),
            **{name: _list(run.rows[name].mean(0)[points]) for name in ("env_steps", "seconds")},
        },
        "up": {
            name: _band(run.rows[column][:, points])
            for name, (column, *_) in UP.items()
            if _has(run.rows[column], name)
        },
    }  # fmt: skip


def _has(values: np.ndarray, name: str) -> bool:
    known = values[~np.isnan(values)]
    return bool(known.any()) if name == "beta" else bool(known.size)


def _band(values: np.ndarray) -> dict[str, Any]:
    """Return mean, interval and seeds of a number, (S, P)."""
    values = np.where(np.isfinite(values), values, np.nan)
    low, high = np.full((2, values.shape[1]), np.nan)
    if len(values) >= LEAST_SEEDS:
        _, low, high = t_interval(values)
    lines = {"mean": values.mean(0), "low": low, "high": high}
    return {name: _list(line) for name, line in lines.items()} | {"seeds": [*map(_list, values)]}


def _list(line: np.ndarray) -> list[float | None]:
    return [_number(value) if np.isfinite(value) else None for value in line.tolist()]


def _number(value: float) -> float:
    """Return a number with the six digits that a picture can show."""
    return float(f"{value:.6g}")
