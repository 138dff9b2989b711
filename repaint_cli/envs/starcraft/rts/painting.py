"""A unit in the layers of the screen and of the minimap.

A disc or a box covers the pixels whose middles are in it, and at least the pixel that its own
middle is in: those are also the pixels that select it. Of 16 points in a pixel, `unit_density_aa`
counts those that are in it. Of an enemy only the pixels show that are visible.
"""

import math
from typing import NamedTuple

import numpy as np

from repaint_cli.envs.starcraft.rts.constants import EDGE, ENEMY, SCREEN, VISIBLE
from repaint_cli.kernels import kernel

SCREEN_VISIBILITY, SCREEN_RELATIVE, SCREEN_TYPE, SCREEN_SELECTED = range(1, 5)
SCREEN_HP, SCREEN_RATIO, DENSITY, DENSITY_AA = range(5, 9)
MINIMAP_VISIBILITY, MINIMAP_RELATIVE, MINIMAP_SELECTED = range(3)
"""Indices of layers."""
MOST_DENSE = 15
"""Units that a pixel of `unit_density` counts at most."""
MOST_HIT_POINTS = 1600.0
"""What the brightest pixel of `unit_hit_points` shows; brightness is logarithmic."""
POINTS = 4
"""Of a pixel, along x and along y, that `unit_density_aa` looks at."""


X, Y, HALF_X, HALF_Y, RELATIVE, KIND, SELECTED, HP, MOST_HP = range(9)
"""Columns of a figure, which is what is drawn of a unit: its middle, the radius of its disc or half
the width of its box (units), half the box's height (0 for a disc), what layers say of it."""


class Lens(NamedTuple):
    """Which part of the map a picture shows."""

    left: float
    top: float
    pixel: float
    """Side of a pixel, units."""


@kernel
def pixels(low: float, high: float, pixel: float) -> tuple[int, int]:
    """Return the first and the end of the pixels that a stretch from an edge touches."""
    first = max(math.floor(low / pixel), 0)
    return first, min(math.floor(high / pixel) + 1, SCREEN)


@kernel
def holds(figure: np.ndarray, dx: float, dy: float) -> bool:
    """Tell whether a point, from the middle of a figure, is in it."""
    if figure[HALF_Y] > 0.0:
        return bool(abs(dx) <= figure[HALF_X] + EDGE and abs(dy) <= figure[HALF_Y] + EDGE)
    return bool(dx * dx + dy * dy <= figure[HALF_X] * figure[HALF_X] + EDGE)


@kernel
def points_in(figure: np.ndarray, dx: float, dy: float, pixel: float) -> int:
    """Return how many of 16 points of a pixel, whose corner is given, are in a figure."""
    if figure[HALF_Y] > 0.0:
        across, along = 0, 0
        for i in range(POINTS):
            across += abs(dx + (i + 0.5) / POINTS * pixel) <= figure[HALF_X] + EDGE
            along += abs(dy - (i + 0.5) / POINTS * pixel) <= figure[HALF_Y] + EDGE
        return across * along
    count, square = 0, figure[HALF_X] * figure[HALF_X] + EDGE
    for j in range(POINTS):
        y = dy - (j + 0.5) / POINTS * pixel
        for i in range(POINTS):
            x = dx + (i + 0.5) / POINTS * pixel
            count += x * x + y * y <= square
    return count


@kernel
def brightness(share: float) -> int:
    """Return a share as a grey level, 0 to 255."""
    return math.floor(255.0 * min(share, 1.0) + 0.5)


@kernel
def paint_screen(layers: np.ndarray, lens: Lens, figure: np.ndarray) -> None:
    """Draw a unit, (9,), over the layers of a screen, (9, 84, 84)."""
    half_y = figure[HALF_Y] if figure[HALF_Y] > 0.0 else figure[HALF_X]
    x, y = figure[X] - lens.left, lens.top - figure[Y]  # from the corner, to the right and down
    first, end = pixels(x - figure[HALF_X], x + figure[HALF_X], lens.pixel)
    top, bottom = pixels(y - half_y, y + half_y, lens.pixel)
    own_column, own_row = math.floor(x / lens.pixel), math.floor(y / lens.pixel)
    hp = brightness(math.log1p(figure[HP]) / math.log1p(MOST_HIT_POINTS))
    ratio = brightness(figure[HP] / figure[MOST_HP])
    for row in range(top, bottom):
        for column in range(first, end):
            if figure[RELATIVE] == ENEMY and layers[SCREEN_VISIBILITY, row, column] != VISIBLE:
                continue
            dx, dy = column * lens.pixel - x, y - row * lens.pixel  # to the pixel's corner
            points = points_in(figure, dx, dy, lens.pixel)
            dense = int(layers[DENSITY_AA, row, column]) + points
            layers[DENSITY_AA, row, column] = min(dense, 255)
            half = lens.pixel / 2.0
            own = column == own_column and row == own_row
            if not (own or holds(figure, dx + half, dy - half)):
                continue
            layers[SCREEN_RELATIVE, row, column] = figure[RELATIVE]
            layers[SCREEN_TYPE, row, column] = figure[KIND]
            layers[SCREEN_SELECTED, row, column] = figure[SELECTED]
            layers[SCREEN_HP, row, column] = hp
            layers[SCREEN_RATIO, row, column] = ratio
            if layers[DENSITY, row, column] < MOST_DENSE:
                layers[DENSITY, row, column] += 1


@kernel
def paint_minimap(layers: np.ndarray, lens: Lens, figure: np.ndarray) -> None:
    """Draw a unit, (9,), over the layers of a minimap, (3, 84, 84)."""
    half_y = figure[HALF_Y] if figure[HALF_Y] > 0.0 else figure[HALF_X]
    x, y = figure[X] - lens.left, lens.top - figure[Y]
    first, end = pixels(x - figure[HALF_X], x + figure[HALF_X], lens.pixel)
    top, bottom = pixels(y - half_y, y + half_y, lens.pixel)
    own_column, own_row = math.floor(x / lens.pixel), math.floor(y / lens.pixel)
    for row in range(top, bottom):
        for column in range(first, end):
            if figure[RELATIVE] == ENEMY and layers[MINIMAP_VISIBILITY, row, column] != VISIBLE:
                continue
            dx, dy = (column + 0.5) * lens.pixel - x, y - (row + 0.5) * lens.pixel
            own = column == own_column and row == own_row
            if own or holds(figure, dx, dy):
                layers[MINIMAP_RELATIVE, row, column] = figure[RELATIVE]
                layers[MINIMAP_SELECTED, row, column] = figure[SELECTED]
