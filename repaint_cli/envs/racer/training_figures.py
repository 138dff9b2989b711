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
from repaint_cli.report.path_panels import frame, grid

PARTS = 4
CLEAR = 0.8
"""Of the largest number on a colour bar: ticks above it would meet its own."""
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
    parts = _parts(episodes)
    width, height = high - low
    figure, panels = grid(len(parts), height / width, title)
    edges = [np.arange(a, b + CELL, CELL) for a, b in zip(low, high, strict=True)]
    visits = [_visits(part, edges) for part in parts]
    scale = LogNorm(1, max(2.0, *(float(count.max()) for count in visits)))
    for axes, part, count in zip(panels, parts, visits, strict=True):
        draw_road(axes, inner, outer, centre)
        _draw_part(axes, part, count, edges, scale)
        frame(axes, _label(part), low, high)
    _colour_bar(figure, panels, scale)
    entries = [legend_entry("left the track", EXIT)]
    if any(trace.status == "crashed" for _, trace in episodes):
        entries.append(legend_entry("crashed", CRASH))
    legend(figure, entries)
    style.save(figure, path)


def _draw_part(
    axes: Axes,
    part: Sequence[TrainingEpisode],
    visits: Floats,
    edges: list[Floats],
    scale: LogNorm,
) -> None:
    """Draw a panel's cells, by their visits (columns, rows), and the ends of its episodes."""
    visited = np.ma.masked_less(visits.T, 1)
    axes.pcolormesh(*edges, visited, cmap=style.ramp(), norm=scale, zorder=2.5, alpha=0.9)
    _mark_ends(axes, part)


def _mark_ends(axes: Axes, part: Sequence[TrainingEpisode]) -> None:
    """Mark where episodes left the road or crashed."""
    for status, mark in (("off_track", EXIT), ("crashed", CRASH)):
        ends = [trace.xy[-1] for _, trace in part if trace.status == status]
        small: Marker = mark | {"markersize": 5, "markeredgewidth": 0.6}
        axes.plot(*np.array(ends).reshape(-1, 2).T, linestyle="none", zorder=5, **small)


def _colour_bar(figure: Figure, panels: list[Axes], scale: LogNorm) -> None:
    bar = figure.colorbar(ScalarMappable(scale, style.ramp()), ax=panels, shrink=0.8, aspect=28)
    bar.set_label(f"steps in a cell of {100 * CELL:.0f} cm", size=style.TEXT_SIZE)
    bar.ax.tick_params(labelsize=style.NOTE_SIZE)
    top = round(float(scale.vmax or 1))
    steps = [step * 10**power for power in range(7) for step in (1, 2, 5)]
    ticks = [*(step for step in steps if step < CLEAR * top), top]
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
    if len(k) == 1:  # lines of one point show nothing
        axes.set_xlim(0.5, 1.5)
        for line in axes.lines[1:]:
            line.set_marker("o")
    axes.set_ylim(-3, 103)
    axes.set_xlabel("iteration", size=style.TEXT_SIZE)
    axes.set_ylabel("lap progress [%]", size=style.TEXT_SIZE)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    style.tidy(axes)
    figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize=style.NOTE_SIZE)
    style.save(figure, path)


def _plot_training_progress(axes: Axes, episodes: Sequence[TrainingEpisode]) -> None:
    """Plot each training episode's progress, their mean, and how many were whole laps."""
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
        driven,
        whole,
        color="#009E73",
        linewidth=1.6,
        linestyle="--",
        label="whole laps [%]",
    )


def _parts(episodes: Sequence[TrainingEpisode]) -> list[list[TrainingEpisode]]:
    """Split a training by its iterations, in fewer parts where it has fewer.

    Parts in which only teachers drove are left out.
    """
    last = max((k for k, _ in episodes), default=1)
    n = min(PARTS, last)
    parts = [
        [(k, trace) for k, trace in episodes if n * (k - 1) // last == part] for part in range(n)
    ]
    return [part for part in parts if part] or [[]]


def _visits(part: Sequence[TrainingEpisode], edges: list[Floats]) -> Floats:
    x, y = np.concatenate([np.empty((0, 2)), *(trace.xy for _, trace in part)]).T
    counts, _, _ = np.histogram2d(x, y, bins=(edges[0], edges[1]))
    return np.asarray(counts, dtype=np.float64)


def _label(part: Sequence[TrainingEpisode]) -> str:
    """Say which part of the training a panel shows, and how many laps it holds."""
    if not part:
        return "no episodes"
    laps = np.mean([trace.status == "lap_complete" for _, trace in part])
    first, last = part[0][0], part[-1][0]
    span = f"iteration {first}" if first == last else f"iterations {first} to {last}"
    return f"{span} · {len(part)} episodes · {100 * laps:.0f} % laps"
