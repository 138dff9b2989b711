"""Learning curves in a grid of panels: a column a task, a row a measure, one legend for all.

**S** seeds · **K** iterations.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import EngFormatter, MaxNLocator

from repaint_cli.report import style
from repaint_cli.report.statistics import Floats

WIDTH, HEIGHT = 4.0, 2.9
"""Of a panel, inches."""
LEAST_WIDTH = 6.4
"""Of a figure, inches."""
LEGEND_WIDTH = 1.6
"""Of an entry of the legend, inches."""
MOST_THIN = 5
"""Seeds of a line that are drawn one by one beside its mean."""
FAR = 0.6
"""How far beyond the curves a target is drawn still, as a share of their range."""
NEAR = 0.1
"""How far below the top a target's name stands under its line, as a share of the range."""


@dataclass(frozen=True)
class Line:
    """A variant's curve in a panel."""

    label: str
    x: Floats
    """Where each seed was evaluated, (S, K)."""
    y: Floats
    """What it had there, (S, K)."""
    band: tuple[Floats, Floats] | None = None
    """The interval of the mean, each (K,)."""


@dataclass(frozen=True)
class CurvePanel:
    """A panel of the grid."""

    title: str
    lines: tuple[Line, ...]
    xlabel: str
    ylabel: str
    target: tuple[float, str] | None = None
    """A dashed line, and its name."""
    percent: bool = False
    """Whether the curves are per cent, from 0 to 100."""


def plot_panels(
    rows: Sequence[Sequence[CurvePanel]], paths: Sequence[Path], *, title: str, note: str
) -> None:
    """Draw a grid of panels; its first row is titled, its last has the x axis named.

    Args:
        rows: of panels, all of one length.
        paths: of the same figure as PNG and SVG.
        title: over the figure.
        note: under it: what lines and shades are.

    Raises:
        StoreError: a file cannot be written.
    """
    n_rows, n_columns = len(rows), len(rows[0])
    labels = list(
        dict.fromkeys(line.label for row in rows for panel in row for line in panel.lines)
    )
    colours = style.colours_of(labels)
    width = max(LEAST_WIDTH, n_columns * WIDTH)
    figure = style.new_figure(width, n_rows * HEIGHT + 1.2)
    style.headline(figure, title)
    grid = figure.subplots(n_rows, n_columns, squeeze=False, sharex="col")
    for r, row in enumerate(rows):
        for c, panel in enumerate(row):
            axes = grid[r, c]
            _panel(axes, panel, colours)
            if r == 0:
                axes.set_title(panel.title, size=style.TEXT_SIZE, color=style.INK)
            if r == n_rows - 1:
                axes.set_xlabel(panel.xlabel, size=style.TEXT_SIZE)
            if c == 0 or panel.ylabel != row[c - 1].ylabel:
                axes.set_ylabel(panel.ylabel, size=style.TEXT_SIZE)
    handles = [Line2D([], [], color=colours[label], linewidth=2.1, label=label) for label in labels]
    columns = max(1, min(len(labels), int(width / LEGEND_WIDTH)))
    figure.legend(
        handles=handles, loc="outside lower center", ncols=columns, frameon=False,
        fontsize=style.TEXT_SIZE, title=note, title_fontsize=style.NOTE_SIZE,
    )  # fmt: skip
    for path in paths:
        style.save(figure, path)


def _panel(axes: Axes, panel: CurvePanel, colours: dict[str, str]) -> None:
    style.tidy(axes)
    for line in panel.lines:
        _line(axes, line, colours[line.label])
    axes.grid(axis="y", color="#e6e6e6", linewidth=0.7)
    axes.set_axisbelow(True)
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True, steps=[1, 2, 5, 10]))
    axes.xaxis.set_major_formatter(EngFormatter(sep=""))
    if panel.percent:
        axes.set_ylim(-3, 103)
    if panel.target:
        _target(axes, *panel.target)


def _line(axes: Axes, line: Line, colour: str) -> None:
    """Draw few seeds, the band, and the mean on top where every seed has a value."""
    if 1 < len(line.y) <= MOST_THIN:
        for x, y in zip(line.x, line.y, strict=True):
            axes.plot(x, y, color=colour, alpha=0.22, linewidth=0.5)
    x, y = line.x.mean(axis=0), line.y.mean(axis=0)
    known = ~np.isnan(y)
    if line.band:
        low, high = (end[known] for end in line.band)
        axes.fill_between(x[known], low, high, color=colour, alpha=0.18, linewidth=0)
    marker = "o" if known.sum() <= 2 else None
    axes.plot(x[known], y[known], color=colour, linewidth=1.9, marker=marker, zorder=3)


def _target(axes: Axes, value: float, name: str) -> None:
    """Draw a dashed line where it is not far beyond the curves; else say where it is."""
    bottom, top = axes.get_ylim()
    text, room, side = f"{name} {value:.4g}", FAR * (top - bottom), "bottom"
    if bottom - room <= value <= top + room:
        axes.axhline(value, color=style.INK, linewidth=1, linestyle=(0, (5, 3)), zorder=2)
        place, units = (0.0, value), ("axes fraction", "data")
        near = value > top - NEAR * (top - bottom)  # the panel's title
        side = "top" if near else "bottom"
    else:
        above = value > top
        place, units = (0.0, 0.93 if above else 0.01), ("axes fraction", "axes fraction")
        text = f"{text}, {'above' if above else 'below'} all that is shown"
    axes.annotate(
        text, place, (3, 3 if side == "bottom" else -3), va=side, xycoords=units,
        textcoords="offset points", size=style.NOTE_SIZE, color=style.INK, zorder=4,
        bbox={"facecolor": "white", "alpha": 0.75, "linewidth": 0, "pad": 0.5},
    )  # fmt: skip
