"""Tracks from above with the paths of cars, a panel an evaluation and track. Metres and m/s.

**E** episodes · **T** steps.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import Normalize, to_rgb
from matplotlib.patches import Patch, Polygon

from repaint_cli.envs.racer.road import BOX_COLOUR, Road, draw_road, lane_patches
from repaint_cli.envs.racer.sweep import cell_of, sweep
from repaint_cli.envs.racer.track.geometry import Floats
from repaint_cli.report import style
from repaint_cli.report.markers import CRASH, EXIT, START, legend, legend_entry
from repaint_cli.report.path_panels import (
    PathPanel,
    colour_bar,
    coloured_paths,
    frame,
    grid,
    mark,
    scale_of,
)

PASSAGE = 0.35
"""How much of the ground one car's passage hides."""


def plot_racer(
    panels: Sequence[PathPanel],
    roads: Sequence[Road],
    path: Path,
    title: str,
    unit: str = "speed [m/s]",
) -> None:
    """Draw tracks from above with paths as wide as the car, one panel a checkpoint and track.

    Args:
        panels: what to draw, in reading order; of several tracks one after the other.
        roads: where the cars of panel i drove, roads[i mod n] of n.
        path: of the PNG.
        title: over the whole figure.
        unit: what the colours are.

    Raises:
        StoreError: the file cannot be written.
    """
    n = len(roads)
    corners = [_corners(road, panels[i::n]) for i, road in enumerate(roads)]
    aspect = max(float(np.divide(*(high - low)[::-1])) for low, high in corners)
    figure, panes = grid(len(panels), aspect, title, n_places=n)
    scale, extend = scale_of(panels)
    for i, (axes, panel) in enumerate(zip(panes, panels, strict=True)):
        low, high = corners[i % n]
        draw_road(axes, *roads[i % n])
        for corners_of_box in panel.boxes if panel.boxes is not None else ():
            box = Polygon(corners_of_box, facecolor=BOX_COLOUR, edgecolor=style.INK, zorder=2.2)
            axes.add_patch(box)
        _swept(axes, panel, scale, low, high)
        coloured_paths(axes, panel.xy, panel.values, scale)
        _starts_and_exits(axes, panel)
        frame(axes, panel.label, low, high)
    if any(panel.values is not None for panel in panels):
        colour_bar(figure, panes, scale, unit, extend)
    legend(figure, _legend_entries(panels))
    style.save(figure, path)


def _corners(road: Road, panels: Sequence[PathPanel]) -> tuple[Floats, Floats]:
    """Return the lower left and upper right corner (2,) of what panels on a road show, m."""
    paths = (panel.xy.reshape(-1, 2) for panel in panels)
    points = np.concatenate([road.inner, road.outer, *paths])
    return np.nanmin(points, axis=0) - 0.2, np.nanmax(points, axis=0) + 0.2


def _legend_entries(panels: Sequence[PathPanel]) -> list[Artist]:
    """Return the legend's entries: lanes, starts, exits; boxes and crashes where there are any."""
    entries: list[Artist] = [legend_entry("start", START), legend_entry("left the track", EXIT)]
    if any(panel.boxes is not None for panel in panels):
        entries.append(Patch(facecolor=BOX_COLOUR, edgecolor=style.INK, label="box"))
    if any(panel.crashes is not None and len(panel.crashes) for panel in panels):
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
    for points, marker in ((panel.exits, EXIT), (panel.crashes, CRASH)):
        if points is not None:
            mark(axes, points, marker)
