"""What another reward pays for logged episodes, beside what was logged. **E** episodes."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from repaint_cli.report import style
from repaint_cli.report.statistics import Floats

LEAST = 4
"""Numbers that a correlation is of, at least: that of fewer says nothing."""
LAP, OTHER = "#0072B2", "#E69F00"
"""Colours of episodes that were whole laps, and of the others."""


def correlation(first: Floats, second: Floats) -> float | None:
    """Return Pearson's correlation of two series.

    None where they are too short, or one of them is the same throughout.
    """
    if len(first) < LEAST or np.ptp(first) == 0 or np.ptp(second) == 0:
        return None
    return float(np.corrcoef(first, second)[0, 1])


def correlation_text(first: Floats, second: Floats) -> str:
    """Return a correlation for people."""
    value = correlation(first, second)
    return "none" if value is None else f"{value:.2f}".replace("-0.00", "0.00")


def plot_replay(logged: Floats, new: Floats, laps: np.ndarray, path: Path, title: str) -> None:
    """Draw the rewards of episodes against each other, and both from episode to episode.

    Args:
        logged: what each was paid, (E,).
        new: what it is paid by the other reward, (E,).
        laps: whether it was a whole lap, (E,) bool.
        path: of the PNG or SVG.
        title: over the whole figure.

    Raises:
        StoreError: the file cannot be written.
    """
    figure = style.new_figure(9.4, 4.4)
    style.headline(figure, title)
    places = figure.add_gridspec(2, 2, width_ratios=(1, 1.15))
    axes = figure.add_subplot(places[:, 0])
    _scatter(axes, logged, new, laps)
    axes.set_xlabel("reward of an episode, logged", size=style.TEXT_SIZE)
    axes.set_ylabel("reward of the same episode, new", size=style.TEXT_SIZE)
    axes.set_title(
        f"correlation over episodes: {correlation_text(logged, new)}", size=style.TEXT_SIZE
    )
    below = figure.add_subplot(places[1, 1])
    above = figure.add_subplot(places[0, 1], sharex=below)
    above.tick_params(labelbottom=False)
    number = np.arange(1.0, len(logged) + 1)
    for panel, values, name in ((above, logged, "logged"), (below, new, "new")):
        panel.plot(number, values, color="#c9c9c9", linewidth=1, zorder=1)
        _scatter(panel, number, values, laps)
        panel.set_ylabel(f"reward, {name}", size=style.TEXT_SIZE)
    below.set_xlabel("episode, in the order of the logs", size=style.TEXT_SIZE)
    below.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1, steps=[1, 2, 5, 10]))
    figure.legend(
        *axes.get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False,
        fontsize=style.NOTE_SIZE,
    )  # fmt: skip
    style.save(figure, path)


def _scatter(axes: Axes, x: Floats, y: Floats, laps: np.ndarray) -> None:
    """Mark episodes, whole laps and others apart."""
    style.tidy(axes)
    axes.grid(axis="y", color="#e6e6e6", linewidth=0.7)
    axes.set_axisbelow(True)
    size = 5 if len(x) <= 200 else 3
    for which, mark, colour, name in (
        (~laps, "X", OTHER, "episode that ended before a lap"), (laps, "o", LAP, "whole lap")
    ):  # fmt: skip
        if not which.any():
            continue
        axes.plot(
            x[which], y[which], mark, color=colour, markersize=size + (mark == "X"), label=name,
            markeredgecolor="w", markeredgewidth=0.4, zorder=3,
        )  # fmt: skip
