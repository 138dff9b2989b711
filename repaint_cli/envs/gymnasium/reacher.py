"""Reacher's fingertip: its paths in the arm's plane, a panel an evaluation. Metres.

**E** episodes · **T** steps.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from repaint_cli.report import style
from repaint_cli.report.markers import TARGET, TIP, legend, legend_entry
from repaint_cli.report.path_panels import (
    PathPanel,
    colour_bar,
    coloured_paths,
    ends_of,
    frame,
    grid,
    mark,
)

REACH = 0.21
"""Length of Reacher's stretched arm, m."""
EDGE = np.array([0.235, 0.235])


def plot_reacher(panels: Sequence[PathPanel], path: Path, title: str) -> None:
    """Draw fingertip paths in the arm's plane, coloured by time, with what they missed by.

    Args:
        panels: what to draw, in reading order; each has targets.
        path: of the PNG.
        title: over the whole figure.

    Raises:
        StoreError: the file cannot be written.
    """
    figure, panes = grid(len(panels), 1.0, title)
    scale = Normalize(0, max((panel.xy.shape[1] - 1 for panel in panels), default=1))
    for axes, panel in zip(panes, panels, strict=True):
        axes.add_patch(Circle((0, 0), REACH, facecolor="#f6f6f6", edgecolor=style.FAINT, lw=0.8))
        axes.plot(0, 0, "+", color=style.FAINT, markersize=8)
        steps = np.broadcast_to(np.arange(panel.xy.shape[1], dtype=np.float64), panel.xy.shape[:2])
        coloured_paths(axes, panel.xy, steps, scale)
        _targets(axes, panel)
        frame(axes, panel.label, -EDGE, EDGE)
        axes.set(xticks=[-0.2, 0, 0.2], yticks=[-0.2, 0, 0.2])
    colour_bar(figure, panes, scale, "time [steps]", "neither")
    miss = Line2D([], [], color=style.INK, linewidth=0.8, linestyle=":", label="missed by")
    reach = Line2D([], [], color=style.FAINT, linewidth=0.8, label="reach of the arm")
    legend(
        figure,
        [legend_entry("target", TARGET), legend_entry("fingertip at the end", TIP), miss, reach],
    )
    style.save(figure, path)


def _targets(axes: Axes, panel: PathPanel) -> None:
    """Mark targets and final fingertips, and join each pair by what is missing between them."""
    ends = ends_of(panel.xy)
    if panel.target is not None:
        misses = np.stack([ends, panel.target], axis=1)
        axes.add_collection(
            LineCollection(
                list(misses), zorder=4, colors=style.INK, linewidths=0.8, linestyles=":"
            ),
            autolim=False,
        )
        mark(axes, panel.target, TARGET)
    mark(axes, ends, TIP)
