"""K(target): how many iterations seeds needed to any return, a line a run."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from repaint_cli.report import style
from repaint_cli.report.arrivals import restricted
from repaint_cli.report.statistics import Floats, iterations_to, t_interval

WIDTH, HEIGHT = 9.4, 4.4
LEVELS = 80
"""Returns at which a line is computed."""
LEAST_SEEDS = 3
"""For an interval, as in the learning curves."""


def plot_targets(
    returns: Mapping[str, Floats], marks: Mapping[float, str], path: Path, *, title: str
) -> None:
    """Draw how many iterations a run's seeds needed to each return, on average.

    A seed that does not get there counts as the last iteration (restricted mean); a line ends where
    no seed gets there.

    Args:
        returns: label → evaluated mean returns (S, K), with as many iterations for all runs.
        marks: returns and what is written at them.
        path: of the PNG or SVG.
        title: over the figure.

    Raises:
        StoreError: the file cannot be written.
    """
    figure, axes = style.one_panel(WIDTH, HEIGHT, title)
    horizon = next(iter(returns.values())).shape[1]
    low = min(float(curves[:, 0].mean()) for curves in returns.values())
    high = max(float(curves.max()) for curves in returns.values())
    levels, colours = np.linspace(low, high, LEVELS), style.colours_of(returns)
    for label, curves in returns.items():
        _line(axes, curves, levels, colours[label], label)
    for level, name in marks.items():
        axes.axvline(level, color=style.FAINT, linewidth=0.8, linestyle=(0, (2, 3)), zorder=0)
        axes.annotate(
            name, (level, 1), (0, 2), xycoords=("data", "axes fraction"), ha="center",
            textcoords="offset points", size=style.NOTE_SIZE, color=style.INK,
        )  # fmt: skip
    axes.set_ylim(0, horizon * 1.04)
    axes.yaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 5, 10]))
    axes.set_xlabel("target: mean evaluation return", size=style.TEXT_SIZE)
    axes.set_ylabel("iterations that a seed needed, K", size=style.TEXT_SIZE)
    style.legend(figure)
    note = f"mean over seeds; one that does not get there counts as {horizon}, the last iteration"
    figure.supxlabel(f"{note}; shaded: 95 % interval", size=style.NOTE_SIZE, color="#555555")
    style.save(figure, path)


def _line(axes: Axes, curves: Floats, levels: Floats, colour: str, label: str) -> None:
    """Draw the mean over a run's seeds, (S, K), and its interval, where any of them gets there."""
    horizon = curves.shape[1]
    reached = np.array([iterations_to(curves, level) for level in levels])  # (L, S)
    some = ~np.isnan(reached).all(axis=1)
    mean, lower, upper = t_interval(restricted(reached[some], horizon).T)
    axes.plot(levels[some], mean, color=colour, linewidth=2.1, label=label)
    if len(curves) >= LEAST_SEEDS:
        ends = np.clip([lower, upper], 1, horizon)
        axes.fill_between(levels[some], *ends, color=colour, alpha=0.15, linewidth=0)
