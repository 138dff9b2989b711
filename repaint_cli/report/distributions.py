"""Distributions of numbers, a panel each: what they are where there is no difference."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import PercentFormatter

from repaint_cli.report import style
from repaint_cli.report.statistics import Floats

WIDTH, HEIGHT, ACROSS = 7.6, 2.3, 2
"""Of the figure in inches; of a row of panels; panels in a row."""

BINS = 40
FILL = "#8fb7d6"


def plot_distributions(
    numbers: Mapping[str, tuple[Floats, float, str, bool]], path: Path, *, title: str, note: str
) -> None:
    """Draw a histogram of each number, with the middle 95 % and where no difference would lie.

    Args:
        numbers: name → values (nan where there is none), the value of no difference, a remark, and
            whether they are shares, which are written in per cent.
        path: of the PNG or SVG.
        title: over the figure.
        note: below it.

    Raises:
        StoreError: the file cannot be written.
    """
    rows = -(-len(numbers) // ACROSS)
    figure = style.new_figure(WIDTH, HEIGHT * rows + 0.8)
    style.headline(figure, title)
    figure.supxlabel(note, size=style.NOTE_SIZE, color="#555555")
    panels = figure.subplots(rows, ACROSS, squeeze=False).ravel()
    for axes, (name, (values, middle, remark, share)) in zip(panels, numbers.items(), strict=False):
        _panel(axes, values[~np.isnan(values)], middle)
        if share:
            axes.xaxis.set_major_formatter(PercentFormatter(1))
        axes.set_title(name, size=style.TEXT_SIZE, loc="left", color=style.INK)
        axes.set_xlabel(remark, size=style.NOTE_SIZE, color=style.INK)
    for axes in panels[len(numbers) :]:
        axes.set_visible(False)
    style.save(figure, path)


def _panel(axes: Axes, values: Floats, middle: float) -> None:
    style.tidy(axes)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    axes.axvline(middle, color=style.INK, linewidth=1, linestyle=(0, (5, 3)))
    if not len(values):
        return
    low, high = np.percentile(values, [2.5, 97.5])
    ends = float(values.min()), float(values.max())
    axes.hist(values, bins=BINS if ends[0] < ends[1] else 1, color=FILL, zorder=0)
    axes.axvspan(low, high, color="#f3f0e6", linewidth=0, zorder=-1)
