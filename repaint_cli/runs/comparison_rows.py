"""A comparison's numbers as rows, for JSON and CSV."""

import csv
import io
from collections.abc import Iterable, Sequence
from math import isnan
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from repaint_cli.report.pairs import Difference
    from repaint_cli.runs.standings import SeedArrivals, Standing

COMPARED = ("first", "area", "area_by_steps", "final")
"""Numbers in which a run is compared with the reference."""

COLUMNS = (
    "run", "method", "seeds", "iterations",
    "first", "first_low", "first_high", "area", "area_low", "area_high",
    "area_by_steps", "area_by_steps_low", "area_by_steps_high", "best",
    "final", "final_low", "final_high", "final_is", "final_each", "runaways",
    *(f"{name}_difference{end}" for name in COMPARED for end in ("", "_low", "_high", "_p")),
    "pairs", "smallest_p", "seeds_needed", "better", "better_low", "better_high",
    "k", "reduced", "env_steps", "seconds", "seconds_reduced", "k_each",
)  # fmt: skip
"""Of comparison.csv: k … k_each are the paper's measure, seeds_needed is of the area."""

TARGET_COLUMNS = (
    "run", "target", "share", "seeds", "arrived", "k", "k_low", "k_high", "earlier", "earlier_low",
    "earlier_high", "logrank_p", "k_each",
)  # fmt: skip
"""Of targets.csv."""

NOTHING = (np.nan,) * 3


def as_row(standing: "Standing", *, nested: bool = False) -> dict[str, object]:
    """Return a run's numbers by the names in `COLUMNS`; None where there is none.

    `nested` adds a list of its targets, each by the names in `TARGET_COLUMNS`.
    """
    from repaint_cli.report.statistics import trims

    against, area = standing.against, standing.against and standing.against.area
    gaps: list[object] = []
    for name in COMPARED:
        gaps += _gap(getattr(against, name) if against else None)
    values: Sequence[object] = (
        standing.label, standing.method, standing.seeds, standing.iterations,
        *standing.first, *standing.area, *standing.area_by_steps, standing.best,
        *standing.final, "iqm" if trims(standing.seeds) else "mean",
        [plain(final) for final in standing.final_each],
        [seed for seed, *_ in standing.runaways], *gaps,
        area and area.pairs, area and area.smallest_p, area and area.seeds_needed,
        *(against.better if against else NOTHING),
        standing.reached, standing.reduced, standing.env_steps, standing.seconds,
        standing.seconds_reduced, [plain(k) for k in standing.reached_each],
    )  # fmt: skip
    row = {name: plain(value) for name, value in zip(COLUMNS, values, strict=True)}
    return row | {"targets": target_rows(standing)} if nested else row


def target_rows(standing: "Standing") -> list[dict[str, object]]:
    """Return when a run's seeds reached each target, by the names in `TARGET_COLUMNS`."""
    return [_target_row(standing, arrivals) for arrivals in standing.targets]


def _target_row(standing: "Standing", arrivals: "SeedArrivals") -> dict[str, object]:
    earlier = arrivals.earlier.mean if arrivals.earlier else NOTHING
    values: Sequence[object] = (
        standing.label, arrivals.target, arrivals.share, standing.seeds, arrivals.arrived,
        *arrivals.k, *earlier, arrivals.p, [plain(k) for k in arrivals.reached_each],
    )  # fmt: skip
    return {name: plain(value) for name, value in zip(TARGET_COLUMNS, values, strict=True)}


def _gap(gap: "Difference | None") -> list[object]:
    return [*NOTHING, np.nan] if gap is None else [*gap.mean, gap.p]


def plain(value: object) -> object:
    """Return a float as JSON knows it: None for nan or ∞, a whole number without a point."""
    if not isinstance(value, float | np.floating):
        return value
    number = float(value)
    if isnan(number) or number in (float("inf"), float("-inf")):
        return None
    return int(number) if number.is_integer() else number


def csv_text(names: Sequence[str], rows: Iterable[Iterable[object]]) -> str:
    """Return a table as CSV; what is not there is empty, and a list has spaces between."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([_cell(value) for value in row] for row in rows)
    return text.getvalue()


def _cell(value: object) -> object:
    if value is None or (isinstance(value, float | np.floating) and isnan(value)):
        return ""
    if isinstance(value, list):
        return " ".join("never" if one is None else f"{one:.6g}" for one in value)
    return f"{value:.6g}" if isinstance(value, float | np.floating) else value
