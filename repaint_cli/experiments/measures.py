"""The numbers of a panel. Every statistic that experiments use is asked for here."""

from dataclasses import dataclass

import numpy as np

from repaint_cli.experiments.results import MeasuredPanel
from repaint_cli.experiments.schema import PaperNumbers
from repaint_cli.report.statistics import Floats, bootstrap_mean
from repaint_cli.runs.comparison import comparison_of, reference_of
from repaint_cli.runs.standings import Standing

REFERENCE = "scratch"
"""The variant, or the method, that others of a panel are compared with."""

LEAST_SEEDS = 3
"""Fewer show no interval."""


@dataclass(frozen=True)
class MeasuredRow:
    """A variant of a panel: our numbers beside the paper's."""

    experiment: str
    panel: str
    ours: Standing
    paper: PaperNumbers | None
    target: float | None
    compared: bool
    """Whether there is a run from scratch that it is not."""

    @property
    def variant(self) -> str:
        """Its name."""
        return self.ours.label


def rows_of(panel: MeasuredPanel) -> list[MeasuredRow]:
    """Return a row for each variant of a panel, compared with training from scratch."""
    reference, target = reference_of(panel.runs, REFERENCE), panel.panel.target
    compared = comparison_of(panel.runs, reference, [] if target is None else [target])
    return [
        MeasuredRow(
            panel.experiment, panel.panel.title, standing, panel.panel.paper, compared.target,
            reference not in (None, standing.label),
        )
        for standing in compared.standings
    ]  # fmt: skip


def target_of(panel: MeasuredPanel) -> tuple[float, str] | None:
    """Return a panel's target and what it is called, None where there is none."""
    if panel.panel.target is not None:
        return panel.panel.target, "target"
    reference = reference_of(panel.runs, REFERENCE)
    if reference is None:
        return None
    best = float(np.nanmax(panel.runs[reference].returns.mean(0)))
    return best, f"best of {reference}"


def interval_of_mean(values: Floats) -> tuple[Floats, Floats] | None:
    """Return the 95 % interval of the mean over seeds of curves (S, K); None with few seeds."""
    return bootstrap_mean(values) if len(values) >= LEAST_SEEDS else None


def smoothed(values: Floats, over: int) -> Floats:
    """Return curves (S, K) averaged over so many iterations, the middle one theirs.

    Near the ends it is over those that are there.
    """
    if over == 1:
        return values
    known = ~np.isnan(values)
    kernel, half = np.ones(over), over // 2

    def summed(row: Floats) -> Floats:
        return np.asarray(np.convolve(row, kernel)[half : half + len(row)], np.float64)

    sums = np.stack([summed(row) for row in np.where(known, values, 0.0)])
    counts = np.stack([summed(row) for row in known.astype(np.float64)])
    return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)
