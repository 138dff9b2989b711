"""Figures of a whole training: where the car drove, and its lap progress. Metres, per cent.

**T** steps · **M** corners of a line.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from repaint_cli.envs.racer.deepracer.traces import Trace
from repaint_cli.envs.racer.road import draw_road
from repaint_cli.envs.racer.track.geometry import Floats
from repaint_cli.report import style
from repaint_cli.report.markers import CRASH, EXIT, Marker, legend, legend_entry

QUARTERS = 4
CELL = 0.05
"""Edge of a cell of the heat-map, m."""


TrainingEpisode = tuple[int, Trace]
"""An iteration, from 1, and an episode of it."""


def plot_heatmap(
    episodes: Sequence[TrainingEpisode],
    inner: Floats,
    outer: Floats,
    centre: Floats,
    path: Path,
    title: str,
) -> None:
    """Draw where the car was in each quarter of its training, and where episodes ended badly.

    Args:
        episodes: all training episodes, in order.
        inner: border on the infield side, (M, 2), m.
        outer: border on the outfield side, (M, 2), m.
        centre: centre line, (M, 2), m.
        path: of the PNG.
        title: over the whole figure.

    Raises:
        StoreError: the file cannot be written.
    """
    points = np.concatenate([inner, outer, *(trace.xy for _, trace in episodes)])
    low, high = points.min(0) - 0.2, points.max(0) + 0.2
    figure, grid = _four_panels(low, high, title)
    quarters = _quarters(episodes)
    edges = [np.arange(a, b + CELL, CELL) for a, b in zip(low, high, strict=True)]
    visits = [_visits(quarter, edges) for quarter in quarters]
    scale = LogNorm(1, max(2.0, *(float(count.max()) for count in visits)))
    for axes, quarter, count in zip(grid.flat, quarters, visits, strict=True):
        draw_road(axes, inner, outer, centre)
        _draw_quarter(axes, quarter, count, edges, scale)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    _colour_bar(figure, list(grid.flat), scale)
    entries = [legend_entry("left the track", EXIT)]
    if any(trace.status == "crashed" for _, trace in episodes):
        entries.append(legend_entry("crashed", CRASH))
    legend(figure, entries)
    style.save(figure, path)


def _four_panels(low: Floats, high: Floats, title: str) -> tuple[Figure, np.ndarray]:
    """Return a figure and its panels, (2, 2), for what lies between two corners (2,), m."""
    side, aspect = 4.3, float(np.clip(np.divide(*(high - low)[::-1]), 0.4, 1.4))
    figure = style.new_figure(2 * side + 1.2, 2 * (side * aspect + 0.4) + 1.1)
    style.headline(figure, title)
    grid = figure.subplots(2, 2, sharex=True, sharey=True)
    for lowest, leftmost in zip(grid[-1], grid[:, 0], strict=True):
        lowest.set_xlabel("x [m]", size=style.NOTE_SIZE)
        leftmost.set_ylabel("y [m]", size=style.NOTE_SIZE)
    return figure, grid


def _draw_quarter(
    axes: Axes,
    quarter: Sequence[TrainingEpisode],
    visits: Floats,
    edges: list[Floats],
    scale: LogNorm,
) -> None:
    """Draw a panel's cells, by their visits (columns, rows), and the ends of its episodes."""
    visited = np.ma.masked_less(visits.T, 1)
    axes.pcolormesh(*edges, visited, cmap=style.ramp(), norm=scale, zorder=2.5, alpha=0.9)
    _mark_ends(axes, quarter)
    axes.set_title(_label(quarter), size=style.TEXT_SIZE - 0.5, color=style.INK)
    axes.set_aspect("equal")
    style.tidy(axes)


def _mark_ends(axes: Axes, quarter: Sequence[TrainingEpisode]) -> None:
    """Mark where episodes left the road or crashed."""
    for status, mark in (("off_track", EXIT), ("crashed", CRASH)):
        ends = [trace.xy[-1] for _, trace in quarter if trace.status == status]
        small: Marker = mark | {"markersize": 5, "markeredgewidth": 0.6}
        axes.plot(*np.array(ends).reshape(-1, 2).T, linestyle="none", zorder=5, **small)


def _colour_bar(figure: Figure, grid: list[Axes], scale: LogNorm) -> None:
    bar = figure.colorbar(ScalarMappable(scale, style.ramp()), ax=grid, shrink=0.8, aspect=28)
    bar.set_label(f"steps in a cell of {100 * CELL:.0f} cm", size=style.TEXT_SIZE)
    bar.ax.tick_params(labelsize=style.NOTE_SIZE)
    steps = [step * 10**power for power in range(5) for step in (1, 2, 5)]
    ticks = [step for step in steps if step <= float(scale.vmax or 1)]
    bar.set_ticks(ticks, labels=[str(tick) for tick in ticks])
    bar.minorticks_off()
    bar.outline.set_visible(False)


def plot_progress(
    episodes: Sequence[TrainingEpisode], evaluated: Floats, path: Path, title: str
) -> None:
    """Draw the progress of each training episode, their mean, and that of the evaluations.

    Args:
        episodes: all training episodes.
        evaluated: mean lap progress of the evaluation after each iteration, (K,), %.
        path: of the PNG.
        title: over the whole figure.

    Raises:
        StoreError: the file cannot be written.
    """
    figure = style.new_figure(7.6, 4.4)
    style.headline(figure, title)
    axes: Axes = figure.subplots()
    _plot_training_progress(axes, episodes)
    k = np.arange(1, len(evaluated) + 1)
    axes.plot(k, evaluated, color="#0072B2", linewidth=2, label="mean of the evaluation")
    axes.set_ylim(-3, 103)
    axes.set_xlabel("iteration", size=style.TEXT_SIZE)
    axes.set_ylabel("lap progress, share of laps [%]", size=style.TEXT_SIZE)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    style.tidy(axes)
    figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize=style.NOTE_SIZE)
    style.save(figure, path)


def _plot_training_progress(axes: Axes, episodes: Sequence[TrainingEpisode]) -> None:
    """Plot each training episode's progress, their mean, and the share of whole laps."""
    iterations = np.array([k for k, _ in episodes])
    progress = np.clip([trace.progress[-1] for _, trace in episodes], 0, 100)
    aside = np.random.default_rng(0).uniform(-0.18, 0.18, len(episodes))
    axes.plot(
        iterations + aside,
        progress,
        ".",
        color=style.FAINT,
        markersize=4,
        alpha=0.6,
        label="training episode",
    )
    driven = np.unique(iterations)
    means = [progress[iterations == k].mean() for k in driven]
    axes.plot(driven, means, color="#E69F00", linewidth=2, label="their mean")
    whole = [100 * (progress[iterations == k] >= 100).mean() for k in driven]
    axes.plot(
        driven, whole, color="#009E73", linewidth=1.6, linestyle="--", label="share of whole laps"
    )


def _quarters(episodes: Sequence[TrainingEpisode]) -> list[list[TrainingEpisode]]:
    """Split a training by its iterations."""
    last = max((k for k, _ in episodes), default=1)
    return [
        [(k, trace) for k, trace in episodes if QUARTERS * (k - 1) // last == quarter]
        for quarter in range(QUARTERS)
    ]


def _visits(quarter: Sequence[TrainingEpisode], edges: list[Floats]) -> Floats:
    x, y = np.concatenate([np.empty((0, 2)), *(trace.xy for _, trace in quarter)]).T
    counts, _, _ = np.histogram2d(x, y, bins=(edges[0], edges[1]))
    return np.asarray(counts, dtype=np.float64)


def _label(quarter: Sequence[TrainingEpisode]) -> str:
    """Say which part of the training a panel shows, and how many laps it holds."""
    if not quarter:
        return "no episodes"
    laps = np.mean([trace.status == "lap_complete" for _, trace in quarter])
    first, last = quarter[0][0], quarter[-1][0]
    span = f"iteration {first}" if first == last else f"iterations {first} to {last}"
    return f"{span} · {len(quarter)} episodes · {100 * laps:.0f} % laps"
