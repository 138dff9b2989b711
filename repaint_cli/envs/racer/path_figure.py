"""A track from above with the paths of cars, a panel an evaluation. Metres and m/s.

**E** episodes · **T** steps · **M** corners of a border.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import Normalize, to_rgb

from repaint_cli.envs.racer.road import draw_road, lane_patches
from repaint_cli.envs.racer.sweep import cell_of, sweep
from repaint_cli.envs.racer.track.geometry import Floats
from repaint_cli.report import style
from repaint_cli.report.markers import CRASH, EXIT, START, legend, legend_entry
from repaint_cli.report.path_panels import (
    PathPanel,
    colour_bar,
    coloured_paths,
    ends_of,
    frame,
    grid,
    mark,
    scale_of,
)

PASSAGE = 0.35
"""How much of the ground one car's passage hides."""


def plot_racer(
    panels: Sequence[PathPanel],
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
    points = np.concatenate([inner, outer, *(panel.xy.reshape(-1, 2) for panel in panels)])
    low, high = np.nanmin(points, axis=0) - 0.2, np.nanmax(points, axis=0) + 0.2
    width, height = high - low
    figure, panes = grid(len(panels), height / width, title)
    scale, extend = scale_of(panels)
    for axes, panel in zip(panes, panels, strict=True):
        draw_road(axes, inner, outer, centre)
        _swept(axes, panel, scale, low, high)
        coloured_paths(axes, panel.xy, panel.values, scale)
        _starts_and_exits(axes, panel)
        frame(axes, panel.label, low, high)
    if any(panel.values is not None for panel in panels):
        colour_bar(figure, panes, scale, unit, extend)
    legend(figure, _legend_entries(panels))
    style.save(figure, path)


def _legend_entries(panels: Sequence[PathPanel]) -> list[Artist]:
    """Return the legend's entries: the lanes, starts and exits, and crashes where there are any."""
    entries = [legend_entry("start", START), legend_entry("left the track", EXIT)]
    if any(panel.crashed is not None and panel.crashed.any() for panel in panels):
        entries.append(legend_entry("crashed", CRASH))
    return [*lane_patches(), *entries]


def _swept(axes: Axes, panel: PathPanel, scale: Normalize, low: Floats, high: Floats) -> None:
    """Colour what the cars swept by the mean value there, fuller where more of them passed."""
    values = panel.values if panel.values is not None else np.zeros(panel.xy.shape[:2])
    passed, means = sweep(panel.xy, values, low, high)
    colours = style.ramp()(scale(np.nan_to_num(means)), bytes=True)  # (rows, columns, 4) uint8
    if panel.values is None:
        colours[..., :3] = 255 * np.array(to_rgb(style.METHOD_COLOURS["repaint"]))
    colours[..., 3] = 255 * (1 - (1 - PASSAGE) ** passed)
    (rows, columns), cell = passed.shape, cell_of(low, high)
    extent = (low[0], low[0] + columns * cell, low[1], low[1] + rows * cell)
    axes.imshow(colours, extent=extent, origin="lower", zorder=2.5, interpolation="bilinear")


def _starts_and_exits(axes: Axes, panel: PathPanel) -> None:
    mark(axes, panel.xy[:, 0], START)
    if panel.ended_off is not None:
        mark(axes, ends_of(panel.xy)[np.asarray(panel.ended_off, dtype=bool)], EXIT)
    if panel.crashed is not None:
        mark(axes, ends_of(panel.xy)[np.asarray(panel.crashed, dtype=bool)], CRASH)
