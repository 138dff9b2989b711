"""What one's own units see: discs of cells around the cell that a unit is in."""

import math

import numpy as np

from repaint_cli.envs.starcraft.rts.constants import (
    BARRACKS,
    COMMAND_CENTRE,
    DEPOT,
    HIDDEN,
    MAP_SIZE,
    MARINE,
    MAX_BARRACKS,
    MAX_DEPOTS,
    MAX_MARINES,
    MAX_SCVS,
    SCV,
    SEEN,
    SITE_SIGHT,
    VISIBLE,
)
from repaint_cli.envs.starcraft.rts.geometry import Game, World
from repaint_cli.envs.starcraft.rts.state import ABSENT
from repaint_cli.kernels import kernel

_LONGEST = int(COMMAND_CENTRE.sight)


def _half_width(sight: int, row: int) -> int:
    """Return how many cells to each side are within a sight, so many rows away; −1: none."""
    return math.isqrt(sight * sight - row * row) if row <= sight else -1


HALF_WIDTHS = np.array(
    [[_half_width(sight, row) for row in range(_LONGEST + 1)] for sight in range(_LONGEST + 1)]
)
"""Cells to each side that a sight reaches, so many rows away, (sight, row); −1: none."""


@kernel
def see(game: Game, world: World, stamped: np.ndarray, x: float, y: float, sight: float) -> None:
    """Make the cells of the map visible whose middles are within a sight of a cell's middle.

    Args:
        game: changed.
        world: its map.
        stamped: the longest sight from each cell so far in this step, changed, (64, 64).
        x: of the unit, whose cell it is.
        y: the same.
        sight: units, whole.
    """
    column = min(max(int(x), 0), MAP_SIZE - 1)
    row = min(max(int(y), 0), MAP_SIZE - 1)
    reach = int(sight)
    if stamped[row, column] >= reach:
        return
    stamped[row, column] = reach
    left, bottom, right, top = world.cells
    for r in range(max(row - reach, bottom), min(row + reach + 1, top)):
        half = HALF_WIDTHS[reach, abs(r - row)]
        for c in range(max(column - half, left), min(column + half + 1, right)):
            game.visibility[r, c] = VISIBLE


@kernel
def structure_sight(game: Game, done: int, sight: float) -> float:
    """Return how far a structure sees, units: less while it is being built."""
    return sight if done <= game.loop else SITE_SIGHT


@kernel
def see_from_structures(game: Game, world: World, stamped: np.ndarray) -> None:
    """Make visible what the centre, depots and barracks see."""
    if world.has_base:
        see(game, world, stamped, world.centre_x, world.centre_y, COMMAND_CENTRE.sight)
    for b in range(MAX_BARRACKS):
        if game.barracks_done[b] > 0:
            sight = structure_sight(game, game.barracks_done[b], BARRACKS.sight)
            see(game, world, stamped, game.barracks_x[b], game.barracks_y[b], sight)
    for d in range(MAX_DEPOTS):
        if game.depot_done[d] > 0:
            sight = structure_sight(game, game.depot_done[d], DEPOT.sight)
            see(game, world, stamped, game.depot_x[d], game.depot_y[d], sight)


@kernel
def dim(game: Game) -> None:
    """Make what was visible something that has been seen."""
    for r in range(MAP_SIZE):
        for c in range(MAP_SIZE):
            game.visibility[r, c] = min(game.visibility[r, c], SEEN)


@kernel
def lift_fog(game: Game, world: World) -> None:
    """Update what is visible and what has been seen; without fog the whole region is visible."""
    if not world.fog:
        for r in range(MAP_SIZE):
            for c in range(MAP_SIZE):
                game.visibility[r, c] = VISIBLE if world.open[r, c] else HIDDEN
        return
    dim(game)
    stamped = np.zeros((MAP_SIZE, MAP_SIZE), np.uint8)
    see_from_structures(game, world, stamped)
    for m in range(MAX_MARINES):
        if game.marine_hp[m] > 0.0:
            see(game, world, stamped, game.marine_x[m], game.marine_y[m], MARINE.sight)
    for i in range(MAX_SCVS):
        if game.scv_state[i] != ABSENT:
            see(game, world, stamped, game.scv_x[i], game.scv_y[i], SCV.sight)
