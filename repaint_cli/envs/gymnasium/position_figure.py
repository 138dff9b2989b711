"""Paths of a position that a user's environment reports, a panel an evaluation.

**E** episodes · **T** steps.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.colors import Normalize

from repaint_cli.report import style
from repaint_cli.report.markers import TIP, legend, legend_entry
from repaint_cli.report.path_panels import (
    PathPanel,
    colour_bar,
    coloured_paths,
    ends_of,
    frame,
    grid,
    mark,
)

MARGIN = 0.05
"""Around all paths, as a share of their extent."""
ASPECTS = (0.3, 1.3)
"""The flattest and the tallest panel, height / width."""


def plot_positions(
    panels: Sequence[PathPanel], names: tuple[str, str], path: Path, title: str
) -> None:
    """Draw paths, coloured by time.

    Args:
        panels: what to draw, in reading order.
        names: of the two numbers, for the axes.
        path: of the PNG.
        title: over the whole figure.

    Raises:
        StoreError: the file cannot be written.
    """
    points = np.concatenate([panel.xy.reshape(-1, 2) for panel in panels])
    points = points[np.isfinite(points).all(1)]
    low, high = (points.min(0), points.max(0)) if len(points) else (np.zeros(2), np.ones(2))
    margin = MARGIN * max((high - low).max(), 1e-9)
    width, height = high - low + 2 * margin
    figure, panes = grid(len(panels), float(np.clip(height / width, *ASPECTS)), title)
    scale = Normalize(0, max(panel.xy.shape[1] - 1 for panel in panels))
    for axes, panel in zip(panes, panels, strict=True):
        axes.set(xlabel=axes.get_xlabel() and names[0], ylabel=axes.get_ylabel() and names[1])
        steps = np.broadcast_to(np.arange(panel.xy.shape[1], dtype=np.float64), panel.xy.shape[:2])
        coloured_paths(axes, panel.xy, steps, scale)
        mark(axes, ends_of(panel.xy), TIP)
        frame(axes, panel.label, low - margin, high + margin)
    colour_bar(figure, panes, scale, "time [steps]", "neither")
    legend(figure, [legend_entry("end", TIP)])
    style.save(figure, path)
