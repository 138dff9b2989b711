"""Paths of evaluated episodes, a panel a checkpoint: the track from above, Reacher's fingertip.

Metres and m/s. **E** episodes · **T** steps · **M** corners of a border.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from repaint_cli.report import look
from repaint_cli.report.road import draw_road, lane_patches
from repaint_cli.report.signs import CRASH, EXIT, START, TARGET, TIP, Sign, legend, sign
from repaint_cli.report.statistics import Floats
from repaint_cli.report.sweep import cell_of, sweep

MAX_COLUMNS = 3
LEAST_SPAN = 0.1
"""Of a scale, as a share of its largest number: noise is not to fill it with colours."""
FEW = 8
"""Different values that all have a place on a scale."""
REACH = 0.21
"""Length of Reacher's stretched arm, m."""
PASSAGE = 0.35
"""How much of the ground one car's passage hides."""
EDGE = np.array([0.235, 0.235])


@dataclass(frozen=True)
class Paths:
    """The paths of one evaluation: one panel."""

    xy: Floats
    """Positions (E, T, 2), m; nan after an episode's end."""
    label: str
    """Over the panel: "iteration 5 · return 212 · progress 63 %"."""
    values: Floats | None = None
    """What colours the steps, (E, T), such as speed or reward; nan after an episode's end."""
    target: Floats | None = None
    """Where each episode's path should lead, (E, 2), m."""
    ended_off: np.ndarray | None = None
    """Which episodes ended off the track, (E,) bool."""
    crashed: np.ndarray | None = None
    """Which ended in a crash, (E,) bool."""

    def __post_init__(self) -> None:
        n_episodes, n_steps, two = self.xy.shape
        wanted = {
            "values": (n_episodes, n_steps),
            "target": (n_episodes, 2),
            "ended_off": (n_episodes,),
            "crashed": (n_episodes,),
        }
        for name, shape in wanted.items():
            found = getattr(self, name)
            if two != 2 or (found is not None and np.shape(found) != shape):
                raise ValueError(f"{name} is {np.shape(found)} beside paths {self.xy.shape}")


def plot_racer(
    panels: Sequence[Paths],
    inner: Floats,
    outer: Floats,
    centre: Floats,
    path: Path,
    title: str,
    unit: str = "speed [m/s]",
) -> None:
    """Draw the track from above with paths as wide as the car, one panel a checkpoint.

    Args:
        panels: what to draw, in reading order.
        inner: border on the infield side, (M, 2), m.
        outer: border on the outfield side, (M, 2), m.
        centre: centre line, (M, 2), m.
        path: of the PNG.
        title: over the whole figure.
        unit: what the colours are.

    Raises:
        StoreError: the file cannot be written.
    """
    points = np.concatenate([inner, outer, *(paths.xy.reshape(-1, 2) for paths in panels)])
    low, high = np.nanmin(points, axis=0) - 0.2, np.nanmax(points, axis=0) + 0.2
    width, height = high - low
    figure, grid = _grid(len(panels), float(np.clip(height / width, 0.4, 1.4)), title)
    scale, extend = _scale(panels)
    for axes, paths in zip(grid, panels, strict=True):
        draw_road(axes, inner, outer, centre)
        _swept(axes, paths, scale, low, high)
        _coloured_paths(axes, paths.xy, paths.values, scale)
        _starts_and_exits(axes, paths)
        _frame(axes, paths.label, low, high)
    if any(paths.values is not None for paths in panels):
        _colour_bar(figure, grid, scale, unit, extend)
    signs = [sign("start", START), sign("left the track", EXIT)]
    if any(paths.crashed is not None and paths.crashed.any() for paths in panels):
        signs.append(sign("crashed", CRASH))
    legend(figure, [*lane_patches(), *signs])
    look.save(figure, path)


def plot_reacher(panels: Sequence[Paths], path: Path, title: str) -> None:
    """Draw fingertip paths in the arm's plane, coloured by time, with what they missed by.

    Args:
        panels: what to draw, in reading order; each has targets.
        path: of the PNG.
        title: over the whole figure.

    Raises:
        StoreError: the file cannot be written.
    """
    figure, grid = _grid(len(panels), 1.0, title)
    scale = Normalize(0, max((paths.xy.shape[1] - 1 for paths in panels), default=1))
    for axes, paths in zip(grid, panels, strict=True):
        axes.add_patch(Circle((0, 0), REACH, facecolor="#f6f6f6", edgecolor=look.FAINT, lw=0.8))
        axes.plot(0, 0, "+", color=look.FAINT, markersize=8)
        steps = np.broadcast_to(np.arange(paths.xy.shape[1], dtype=np.float64), paths.xy.shape[:2])
        _coloured_paths(axes, paths.xy, steps, scale)
        _targets(axes, paths)
        _frame(axes, paths.label, -EDGE, EDGE)
        axes.set(xticks=[-0.2, 0, 0.2], yticks=[-0.2, 0, 0.2])
    _colour_bar(figure, grid, scale, "time [steps]", "neither")
    miss = Line2D([], [], color=look.INK, linewidth=0.8, linestyle=":", label="missed by")
    reach = Line2D([], [], color=look.FAINT, linewidth=0.8, label="reach of the arm")
    legend(figure, [sign("target", TARGET), sign("fingertip at the end", TIP), miss, reach])
    look.save(figure, path)


def _grid(n_panels: int, aspect: float, title: str) -> tuple[Figure, list[Axes]]:
    """Return a figure with so many panels of height/width `aspect`, at most three a row."""
    columns = 2 if n_panels == 4 else max(1, min(n_panels, MAX_COLUMNS))
    rows = max(1, -(-n_panels // columns))
    side = {1: 5.6, 2: 4.3}.get(columns, 3.6)
    figure = look.new_figure(columns * side + 1.2, rows * (side * aspect + 0.35) + 1.1)
    look.headline(figure, title)
    places = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    for empty in places[n_panels:]:
        empty.set_visible(False)
    for i, axes in enumerate(places[:n_panels]):
        axes.tick_params(labelbottom=i + columns >= n_panels)
        axes.set_xlabel("x [m]" if i + columns >= n_panels else "", size=look.NOTE_SIZE)
        axes.set_ylabel("y [m]" if i % columns == 0 else "", size=look.NOTE_SIZE)
    return figure, list(places[:n_panels])


def _frame(axes: Axes, label: str, low: Floats, high: Floats) -> None:
    """Name a panel and show what lies between two corners (2,), m, at the same scale both ways."""
    look.tidy(axes)
    axes.set_title(label, size=look.TEXT_SIZE - 0.5, color=look.INK)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])


def _scale(panels: Sequence[Paths]) -> tuple[Normalize, str]:
    """Return one scale for all panels, without the outer 2 % of many values, and what overflows."""
    known = [np.ravel(paths.values) for paths in panels if paths.values is not None]
    values = np.concatenate([*known, np.empty(0)])
    values = values[np.isfinite(values)]
    if len(values) == 0:
        return Normalize(0, 1), "neither"
    most = [2, 98] if len(np.unique(values)) > FEW else [0, 100]
    low, high = (float(end) for end in np.percentile(values, most))
    least = LEAST_SPAN * max(abs(low), abs(high)) or 1.0
    if high - low < least:
        low, high = low - least / 2, high + least / 2
    below, above = bool(values.min() < low), bool(values.max() > high)
    return Normalize(low, high), {(1, 1): "both", (1, 0): "min", (0, 1): "max"}.get(
        (below, above), "neither"
    )


def _coloured_paths(axes: Axes, xy: Floats, values: Floats | None, scale: Normalize) -> None:
    """Draw every step as a short line in the colour of its value; nan ends a path."""
    segments = np.stack([xy[:, :-1], xy[:, 1:]], axis=2).reshape(-1, 2, 2)  # (E·(T−1), 2, 2)
    whole = np.isfinite(segments).all(axis=(1, 2))
    lines = LineCollection(list(segments[whole]), linewidths=1.0, capstyle="round", zorder=3)
    if values is None:
        lines.set_color(look.METHOD_COLOURS["repaint"])
    else:
        lines.set(array=values[:, 1:].reshape(-1)[whole], cmap=look.ramp(), norm=scale)
    axes.add_collection(lines, autolim=False)


def _swept(axes: Axes, paths: Paths, scale: Normalize, low: Floats, high: Floats) -> None:
    """Colour what the cars swept by the mean value there, fuller where more of them passed."""
    known = paths.values is not None
    values = paths.values if paths.values is not None else np.zeros(paths.xy.shape[:2])
    passed, means = sweep(paths.xy, values, low, high)
    colours = look.ramp()(scale(np.nan_to_num(means)), bytes=True)  # (rows, columns, 4) uint8
    if not known:
        colours[..., :3] = 255 * np.array(to_rgb(look.METHOD_COLOURS["repaint"]))
    colours[..., 3] = 255 * (1 - (1 - PASSAGE) ** passed)
    (rows, columns), cell = passed.shape, cell_of(low, high)
    extent = (low[0], low[0] + columns * cell, low[1], low[1] + rows * cell)
    axes.imshow(colours, extent=extent, origin="lower", zorder=2.5, interpolation="bilinear")


def _ends(xy: Floats) -> Floats:
    """Return the last known point of each episode that has one, else nan, (E, 2)."""
    known = ~np.isnan(xy[:, :, 0])  # (E, T)
    last = known.shape[1] - 1 - np.argmax(known[:, ::-1], axis=1)
    return np.asarray(xy[np.arange(len(xy)), last])


def _starts_and_exits(axes: Axes, paths: Paths) -> None:
    _mark(axes, paths.xy[:, 0], START)
    if paths.ended_off is not None:
        _mark(axes, _ends(paths.xy)[np.asarray(paths.ended_off, dtype=bool)], EXIT)
    if paths.crashed is not None:
        _mark(axes, _ends(paths.xy)[np.asarray(paths.crashed, dtype=bool)], CRASH)


def _mark(axes: Axes, points: Floats, drawn_as: Sign) -> None:
    axes.plot(*points.T, linestyle="none", zorder=5, **drawn_as)


def _targets(axes: Axes, paths: Paths) -> None:
    """Mark targets and final fingertips, and join each pair by what is missing between them."""
    ends = _ends(paths.xy)
    if paths.target is not None:
        misses = np.stack([ends, paths.target], axis=1)
        axes.add_collection(
            LineCollection(list(misses), zorder=4, colors=look.INK, linewidths=0.8, linestyles=":"),
            autolim=False,
        )
        _mark(axes, paths.target, TARGET)
    _mark(axes, ends, TIP)


def _colour_bar(
    figure: Figure, grid: list[Axes], scale: Normalize, label: str, extend: str
) -> None:
    bar = figure.colorbar(
        ScalarMappable(scale, look.ramp()), ax=grid, extend=extend, shrink=0.8, aspect=28, pad=0.02
    )
    bar.set_label(label, size=look.TEXT_SIZE)
    bar.ax.tick_params(labelsize=look.NOTE_SIZE)
    bar.outline.set_visible(False)
