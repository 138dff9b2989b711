"""The numbers of a panel. Every statistic that experiments use is asked for here."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from repaint_cli.experiments.results import MeasuredPanel
from repaint_cli.experiments.schema import PaperNumbers
from repaint_cli.report.statistics import Floats, first_and_converged, t_interval
from repaint_cli.runs.aggregate import Aggregated, Pair, aggregated
from repaint_cli.runs.comparison import REFERENCE, Comparison, comparison_of, reference_of
from repaint_cli.runs.standings import Standing

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


def compared(panel: MeasuredPanel) -> Comparison:
    """Compare the variants of a panel with training from scratch."""
    target = panel.panel.target
    reference = reference_of(panel.runs, REFERENCE)
    return comparison_of(panel.runs, reference, [] if target is None else [target])


def rows_of(panel: MeasuredPanel) -> list[MeasuredRow]:
    """Return a row for each variant of a panel."""
    comparison = compared(panel)
    return [
        MeasuredRow(
            panel.experiment, panel.panel.title, standing, panel.panel.paper, comparison.target,
            comparison.reference not in (None, standing.label),
        )
        for standing in comparison.standings
    ]  # fmt: skip


def over_panels(panels: Sequence[MeasuredPanel]) -> dict[str, Aggregated]:
    """Return each variant's numbers over all panels in which training from scratch learned.

    A variant needs two of them.
    """
    pairs: dict[str, list[Pair]] = {}
    for panel in panels:
        reference = reference_of(panel.runs, REFERENCE)
        if reference is None or first_and_converged(panel.runs[reference].returns) is None:
            continue
        for variant, run in panel.runs.items():
            name = f"{panel.experiment}: {panel.panel.title}"
            if variant != reference:
                pairs.setdefault(variant, []).append(Pair(name, run, panel.runs[reference]))
    return {variant: aggregated(own) for variant, own in pairs.items() if len(own) > 1}


def target_of(panel: MeasuredPanel) -> tuple[float, str] | None:
    """Return a panel's target and what it is called, None where there is none."""
    comparison = compared(panel)
    if comparison.target is None:
        return None
    name = "target" if comparison.given else f"best of {comparison.reference}"
    return comparison.target, name


def interval_of_mean(values: Floats) -> tuple[Floats, Floats] | None:
    """Return the 95 % interval of the mean over seeds of curves (S, K); None with few seeds."""
    _, low, high = t_interval(values)
    return (low, high) if len(values) >= LEAST_SEEDS else None


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
