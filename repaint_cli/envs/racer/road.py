"""A track from above: two lanes in two greys, white borders, a dashed centre line. Metres."""

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path as Outline

from repaint_cli.envs.racer.sight.boxes import BOT_LENGTH, BOT_WIDTH
from repaint_cli.envs.racer.track.geometry import Floats

CAR_LENGTH, CAR_WIDTH = round(BOT_LENGTH, 2), round(BOT_WIDTH, 2)
"""Of a car in figures: its visible body, in whole cm, centred on the base, m."""
BOX_COLOUR = "#D8A45F"
INNER_LANE, OUTER_LANE, BORDER, DASHES = "#cfcfcf", "#dedede", "#333333", "#ffffff"


class Road(NamedTuple):
    """The lines of a road."""

    inner: Floats
    """Border on the infield side, (M, 2), m."""
    outer: Floats
    """Border on the outfield side, (M, 2), m."""
    centre: Floats
    """Centre line, (M, 2), m."""


def draw_road(axes: Axes, inner: Floats, outer: Floats, centre: Floats) -> None:
    """Draw a road; lines whose last corner is their first are closed.

    Args:
        axes: where to.
        inner: border on the infield side, (M, 2), m.
        outer: border on the outfield side, (M, 2), m.
        centre: centre line, (M, 2), m; the lanes meet there.
    """
    axes.add_patch(PathPatch(_between(centre, outer), facecolor=OUTER_LANE, linewidth=0, zorder=1))
    axes.add_patch(PathPatch(_between(inner, centre), facecolor=INNER_LANE, linewidth=0, zorder=1))
    for border in (inner, outer):
        axes.plot(*border.T, color=BORDER, linewidth=0.9, zorder=2)
    axes.plot(*centre.T, color=DASHES, linewidth=1.2, linestyle=(0, (4, 3)), zorder=2)


def body_corners(x: float, y: float, heading: float, size: tuple[float, float]) -> Floats:
    """Return the corners of a body (4, 2), m, of some length and width (m), about its middle."""
    ahead, left = size[0] / 2, size[1] / 2
    own = np.array([[-ahead, -left], [ahead, -left], [ahead, left], [-ahead, left]])
    cos, sin = np.cos(heading), np.sin(heading)
    return np.asarray([x, y] + own @ np.array([[cos, sin], [-sin, cos]]))


def lane_patches() -> list[Patch]:
    """Return what the legend shows for the two lanes."""
    lanes = {"inner lane": INNER_LANE, "outer lane": OUTER_LANE}
    return [Patch(color=colour, label=name) for name, colour in lanes.items()]


def _between(hole: Floats, edge: Floats) -> Outline:
    """Return the outline of what lies between two lines (M, 2), the first inside the second."""
    if not np.array_equal(edge[0], edge[-1]):  # an open road: there along one, back along the other
        return Outline(np.vstack([edge, hole[::-1], edge[:1]]))
    rings = [_winding(edge, 1), _winding(hole, -1)]
    codes = [Outline.MOVETO, Outline.LINETO]
    return Outline(
        np.vstack(rings), np.concatenate([np.repeat(codes, [1, len(ring) - 1]) for ring in rings])
    )


def _winding(ring: Floats, sense: int) -> Floats:
    """Return the ring running counter-clockwise (1) or clockwise (−1), as a hole must."""
    x, y = ring.T
    area = float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))
    return ring if area * sense > 0 else ring[::-1]
