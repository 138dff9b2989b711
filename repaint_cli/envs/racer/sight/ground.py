"""The ground of the camera images: a grey picture of the track from above, painted once a track.

Luma values are those of the DeepRacer simulator's own pictures. The picture covers the field, a
rectangle around the outer border that is fenced by walls, at 5 mm a texel, with three half-sized
copies for what is far away.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.track.geometry import Floats
from repaint_cli.envs.racer.track.track import Track
from repaint_cli.kernels import kernel

ROAD, LINE, CENTRE_LINE, FIELD = 52.0, 222.0, 148.0, 128.0
"""Grey levels of road, border lines, centre dashes and field."""
LINE_WIDTH = 0.076
"""Of the white lines, which lie inside the road along its borders, m."""
CENTRE_WIDTH = 0.026
DASH = 0.0508
"""Length of a centre dash, and of the gap after it, m."""
FIELD_MARGIN = 0.91
"""From the outer border's bounding box to the walls, m."""
TEXEL = 0.005
"""Edge of a texel on level 0, m."""
LEVELS = 4
_PAD = 16  # texels of field beyond the walls, so that interpolation never leaves the picture
_FAR = 1e9


@dataclass(frozen=True, eq=False)
class Ground:
    """A painted track. Arrays are read-only."""

    levels: tuple[NDArray[np.uint8], ...]
    """Grey pictures (rows by y, columns by x); each level halves the one before it."""
    origin: Floats
    """World position of every level's lower left corner, (2,), m."""
    field: Floats
    """The walls: least x, least y, greatest x, greatest y, (4,), m."""


@lru_cache(maxsize=64)
def ground_of(track: Track) -> Ground:
    """Paint a track, or return it from the cache: environments of one track share their ground."""
    edge, _ = track.outline
    low, high = edge.min(axis=0) - FIELD_MARGIN, edge.max(axis=0) + FIELD_MARGIN
    origin = low - _PAD * TEXEL
    coarsest = 2 ** (LEVELS - 1)
    columns, rows = (
        -(-int(np.ceil(extent / TEXEL)) // coarsest) * coarsest
        for extent in high - low + 2 * _PAD * TEXEL
    )
    levels = [_paint(track, origin, rows, columns)]
    for _ in range(LEVELS - 1):
        levels.append(_halved(levels[-1]))
    for level in levels:
        level.flags.writeable = False
    return Ground(tuple(levels), origin, np.concatenate([low, high]))


def _paint(track: Track, origin: Floats, rows: int, columns: int) -> NDArray[np.uint8]:
    """Paint level 0, (rows, columns)."""
    border_gap = np.full((rows, columns), _FAR, dtype=np.float32)
    centre_gap = np.full((rows, columns), _FAR, dtype=np.float32)
    along = np.zeros((rows, columns), dtype=np.float32)
    reach = LINE_WIDTH + 2 * TEXEL
    for border in (track.inner, track.outer):
        _near_line(border, np.zeros(len(border)), origin, reach, border_gap, along)
    _near_line(track.centre, track.distances, origin, reach, centre_gap, along)
    on_road = np.zeros((rows, columns), dtype=np.bool_)
    for ring in track.outline:  # even-odd: the second removes the infield
        _flip_inside(ring, origin, on_road)
    picture = np.empty((rows, columns), dtype=np.uint8)
    _mix(border_gap, centre_gap, along, on_road, picture)
    return picture


@kernel
def _near_line(
    line: np.ndarray,
    distances: np.ndarray,
    origin: np.ndarray,
    reach: float,
    gap: np.ndarray,
    along: np.ndarray,
) -> None:
    """Lower `gap` to each texel's distance from the line within `reach`; note the arclength."""
    rows, columns = gap.shape
    for i in range(len(line) - 1):
        ax, ay = line[i, 0] - origin[0], line[i, 1] - origin[1]
        dx, dy = line[i + 1, 0] - line[i, 0], line[i + 1, 1] - line[i, 1]
        squared = dx * dx + dy * dy
        first_row = max(int((min(ay, ay + dy) - reach) / TEXEL), 0)
        last_row = min(int((max(ay, ay + dy) + reach) / TEXEL) + 1, rows)
        first_column = max(int((min(ax, ax + dx) - reach) / TEXEL), 0)
        last_column = min(int((max(ax, ax + dx) + reach) / TEXEL) + 1, columns)
        for r in range(first_row, last_row):
            y = (r + 0.5) * TEXEL - ay
            for c in range(first_column, last_column):
                x = (c + 0.5) * TEXEL - ax
                share = 0.0
                if squared > 0.0:
                    share = min(max((x * dx + y * dy) / squared, 0.0), 1.0)
                distance = np.sqrt((x - share * dx) ** 2 + (y - share * dy) ** 2)
                if distance < gap[r, c]:
                    gap[r, c] = distance
                    along[r, c] = distances[i] + share * (distances[i + 1] - distances[i])


@kernel
def _flip_inside(ring: np.ndarray, origin: np.ndarray, inside: np.ndarray) -> None:
    """Flip the flags of the texels inside the ring, (rows, columns)."""
    rows, columns = inside.shape
    crossings = np.empty(len(ring))
    for r in range(rows):
        y = origin[1] + (r + 0.5) * TEXEL
        n = 0
        for i in range(len(ring) - 1):
            ay, by = ring[i, 1], ring[i + 1, 1]
            if (ay > y) != (by > y):
                crossings[n] = ring[i, 0] + (y - ay) * (ring[i + 1, 0] - ring[i, 0]) / (by - ay)
                n += 1
        crossings[:n].sort()
        for k in range(0, n, 2):
            first = int(np.ceil((crossings[k] - origin[0]) / TEXEL - 0.5))
            last = int(np.ceil((crossings[k + 1] - origin[0]) / TEXEL - 0.5))
            for c in range(max(first, 0), min(last, columns)):
                inside[r, c] = not inside[r, c]


@kernel
def luma(border_gap: float, centre_gap: float, along: float, on_road: bool) -> float:
    """Return the grey level of a ground point; edges are ramps one texel wide.

    Args:
        border_gap: distance to the nearer border, m.
        centre_gap: distance to the centre line, m.
        along: arclength of the nearest point on the centre line, m.
        on_road: whether the point is between the borders.
    """
    depth = border_gap if on_road else -border_gap
    on = min(max(depth / TEXEL + 0.5, 0.0), 1.0)
    past_line = min(max((depth - LINE_WIDTH) / TEXEL + 0.5, 0.0), 1.0)
    dash_gap = abs(along % (2 * DASH) - DASH / 2)  # from the dash's middle
    dash_gap = min(dash_gap, 2 * DASH - dash_gap)
    dash = min(max((DASH / 2 - dash_gap) / TEXEL + 0.5, 0.0), 1.0)
    dash *= min(max((CENTRE_WIDTH / 2 - centre_gap) / TEXEL + 0.5, 0.0), 1.0)
    road = ROAD + dash * (CENTRE_LINE - ROAD)
    return FIELD + on * (LINE - FIELD) + past_line * (road - LINE)


@kernel
def _mix(
    border_gap: np.ndarray,
    centre_gap: np.ndarray,
    along: np.ndarray,
    on_road: np.ndarray,
    picture: np.ndarray,
) -> None:
    """Fill the picture with `luma`, all (rows, columns)."""
    rows, columns = picture.shape
    for r in range(rows):
        for c in range(columns):
            level = luma(border_gap[r, c], centre_gap[r, c], along[r, c], on_road[r, c])
            picture[r, c] = np.uint8(level + 0.5)


def _halved(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Average squares of 2×2 texels, (2R, 2C) to (R, C)."""
    rows, columns = picture.shape
    blocks = picture.reshape(rows // 2, 2, columns // 2, 2).astype(np.float32)
    halved: NDArray[np.uint8] = (blocks.mean(axis=(1, 3)) + 0.5).astype(np.uint8)
    return halved
