"""Units of a kind push each other apart, once a step; structures push out marines that stand."""

import numpy as np

from repaint_cli.envs.starcraft.rts.constants import (
    BARRACKS,
    COMMAND_CENTRE,
    DEPOT,
    LOOPS_PER_STEP,
    MAP_SIZE,
    MARINE,
    MAX_BARRACKS,
    MAX_DEPOTS,
    MAX_MARINES,
    MAX_ZERGLINGS,
    PATCH_HALF_HEIGHT,
    PATCH_HALF_WIDTH,
)
from repaint_cli.envs.starcraft.rts.geometry import Game, World, keep_out
from repaint_cli.envs.starcraft.rts.state import NO_ORDER
from repaint_cli.kernels import kernel

APART = 2.0 * MARINE.radius
"""Between the middles of two units, units; zerglings have the same radius."""
TURNS = 16
"""A marine is held against the structures once in so many steps."""


@kernel
def push_pair(xs: np.ndarray, ys: np.ndarray, i: int, j: int) -> None:
    """Move two overlapping units apart, each by half; if they are in one place, along x."""
    dx, dy = xs[j] - xs[i], ys[j] - ys[i]
    square = dx * dx + dy * dy
    if square >= APART * APART:
        return
    way = np.sqrt(square)
    if way < 1e-6:
        dx, dy, way = 1.0, 0.0, 1.0
        push = APART / 2.0
    else:
        push = (APART - way) / 2.0
    xs[i] -= push * dx / way
    ys[i] -= push * dy / way
    xs[j] += push * dx / way
    ys[j] += push * dy / way


@kernel
def push_apart(xs: np.ndarray, ys: np.ndarray, hps: np.ndarray, cells: np.ndarray) -> None:
    """Push the living units of a kind apart, each pair that shares a cell or has cells that touch.

    Cells are those in which the units were before; each unit meets those of a smaller index, in the
    cells around it row by row, the latest first.

    Args:
        xs: of the units, changed, (U,).
        ys: the same of y.
        hps: 0 where there is none, (U,).
        cells: filled with −1 before and after, (64, 64).
    """
    units = len(xs)
    follows = np.empty(units, np.int16)
    columns, rows = np.empty(units, np.int16), np.empty(units, np.int16)
    for i in range(units):
        if hps[i] <= 0.0:
            continue
        column = min(max(int(xs[i]), 0), MAP_SIZE - 1)
        row = min(max(int(ys[i]), 0), MAP_SIZE - 1)
        columns[i], rows[i] = column, row
        for r in range(max(row - 1, 0), min(row + 2, MAP_SIZE)):
            for c in range(max(column - 1, 0), min(column + 2, MAP_SIZE)):
                j = cells[r, c]
                while j >= 0:
                    push_pair(xs, ys, i, j)
                    j = follows[j]
        follows[i] = cells[row, column]
        cells[row, column] = i
    for i in range(units):
        if hps[i] > 0.0:
            cells[rows[i], columns[i]] = -1


@kernel
def push_out(game: Game, m: int, x: float, y: float, half_x: float, half_y: float) -> None:
    """Move a marine that overlaps a box around (x, y) out of it, the shortest way."""
    dx, dy = game.marine_x[m] - x, game.marine_y[m] - y
    over_x = half_x + MARINE.radius - abs(dx)
    over_y = half_y + MARINE.radius - abs(dy)
    if over_x <= 0.0 or over_y <= 0.0:
        return
    if over_x < over_y:
        game.marine_x[m] += over_x if dx >= 0.0 else -over_x
    else:
        game.marine_y[m] += over_y if dy >= 0.0 else -over_y


@kernel
def leave_structures(game: Game, world: World, m: int) -> None:
    """Move a marine out of what stands in its place."""
    r = COMMAND_CENTRE.radius
    push_out(game, m, world.centre_x, world.centre_y, r, r)
    for p in range(world.patches):
        if game.patch_left[p] > 0:
            x, y = world.patch_x[p], world.patch_y[p]
            push_out(game, m, x, y, PATCH_HALF_WIDTH, PATCH_HALF_HEIGHT)
    r = DEPOT.radius
    for d in range(MAX_DEPOTS):
        if game.depot_done[d] > 0:
            push_out(game, m, game.depot_x[d], game.depot_y[d], r, r)
    r = BARRACKS.radius
    for b in range(MAX_BARRACKS):
        if game.barracks_done[b] > 0:
            push_out(game, m, game.barracks_x[b], game.barracks_y[b], r, r)


@kernel
def make_room(game: Game, world: World, cells: np.ndarray) -> None:
    """Push units apart, marines out of structures, and all of them back onto the map.

    Args:
        game: changed.
        world: its map.
        cells: filled with −1 before and after, (64, 64).
    """
    if game.army_count > 0:
        push_apart(game.marine_x, game.marine_y, game.marine_hp, cells)
    turn = (game.loop // LOOPS_PER_STEP) % TURNS
    left, bottom = world.region[0] + MARINE.radius, world.region[1] + MARINE.radius
    right, top = world.region[2] - MARINE.radius, world.region[3] - MARINE.radius
    for m in range(MAX_MARINES):
        if game.marine_hp[m] > 0.0:
            if world.has_base and m % TURNS == turn and game.marine_order[m] == NO_ORDER:
                leave_structures(game, world, m)
            game.marine_x[m] = min(max(game.marine_x[m], left), right)
            game.marine_y[m] = min(max(game.marine_y[m], bottom), top)
    if world.zerglings == 0:
        return
    push_apart(game.zergling_x, game.zergling_y, game.zergling_hp, cells)
    for z in range(MAX_ZERGLINGS):
        if game.zergling_hp[z] > 0.0:
            game.zergling_x[z] = min(max(game.zergling_x[z], left), right)
            game.zergling_y[z] = min(max(game.zergling_y[z], bottom), top)
            keep_out(game, world, z)
