"""Where things are: pixels and places, walks of SCVs, boxes, and draws of chance."""

import math
from typing import Any

import numpy as np

from repaint_cli.envs.starcraft.rts.constants import (
    ACCELERATION,
    EDGE,
    LEG_LOOPS,
    LOOPS_PER_SECOND,
    SCV,
)
from repaint_cli.kernels import kernel

Game = Any
"""A record of `state.GAME`: numba reads and changes its fields in place."""
World = Any
"""A record of `world.WORLD`."""

_TOP_SPEED = SCV.speed * LOOPS_PER_SECOND
_SHORT = _TOP_SPEED * _TOP_SPEED / ACCELERATION  # a shorter walk never reaches the top speed, units


@kernel
def chance(game: Game) -> float:
    """Draw a number in [0, 1) from a game's own counter (splitmix64, Steele et al. 2014)."""
    game.rng = game.rng + np.uint64(0x9E3779B97F4A7C15)
    z = game.rng
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return float(np.int64(z >> np.uint64(11)) * (1.0 / 9007199254740992.0))


@kernel
def distance(x0: float, y0: float, x1: float, y1: float) -> float:
    """Return how far it is from one place to another, units."""
    return math.sqrt((x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0))


@kernel
def walk_loops(way: float) -> float:
    """Return how long an SCV takes over a way, loops.

    It accelerates and brakes at a = 2.5 units/s², up to v = 2.8125 units/s, then turns:

        t = 2·√(d/a) for d < v²/a, else d/v + v/a
    """
    if way < _SHORT:
        seconds = 2.0 * math.sqrt(way / ACCELERATION)
    else:
        seconds = way / _TOP_SPEED + _TOP_SPEED / ACCELERATION
    return seconds * LOOPS_PER_SECOND + LEG_LOOPS


@kernel
def walked_share(way: float, loops: float) -> float:
    """Return which share of a way an SCV has walked after some loops; see `walk_loops`."""
    whole = walk_loops(way) - LEG_LOOPS
    if way <= 0.0 or loops >= whole:
        return 1.0
    if loops <= 0.0:
        return 0.0
    seconds, left = loops / LOOPS_PER_SECOND, (whole - loops) / LOOPS_PER_SECOND
    ramp = min(_TOP_SPEED / ACCELERATION, whole / LOOPS_PER_SECOND / 2.0)
    if seconds < ramp:
        done = ACCELERATION * seconds * seconds / 2.0
    elif left < ramp:
        done = way - ACCELERATION * left * left / 2.0
    else:
        done = ACCELERATION * ramp * ramp / 2.0 + _TOP_SPEED * (seconds - ramp)
    return done / way


@kernel
def place_scv(game: Game, i: int) -> None:
    """Put an SCV where its walk has brought it by now."""
    x0, y0, x1, y1 = game.scv_x0[i], game.scv_y0[i], game.scv_x1[i], game.scv_y1[i]
    share = walked_share(distance(x0, y0, x1, y1), game.loop - game.scv_t0[i])
    game.scv_x[i] = x0 + share * (x1 - x0)
    game.scv_y[i] = y0 + share * (y1 - y0)


@kernel
def boxes_overlap(x0: float, y0: float, half: float, x1: float, y1: float,
                  half_x: float, half_y: float) -> bool:  # fmt: skip
    """Tell whether a square around one place and a box around another share more than an edge."""
    return abs(x1 - x0) < half + half_x and abs(y1 - y0) < half + half_y


@kernel
def inside(x: float, y: float, area: np.ndarray, margin: float) -> bool:
    """Tell whether a place is in a rectangle (left, bottom, right, top) grown by a margin."""
    across = area[0] - margin <= x <= area[2] + margin
    return bool(across and area[1] - margin <= y <= area[3] + margin)


@kernel
def keep_out(game: Game, world: World, z: int) -> None:
    """Put a zergling that is in the base on the nearest point of its border."""
    x, y, base = game.zergling_x[z], game.zergling_y[z], world.base
    if not (world.has_base and base[0] < x < base[2] and base[1] < y < base[3]):
        return
    across, along = min(x - base[0], base[2] - x), min(y - base[1], base[3] - y)
    if across < along:
        game.zergling_x[z] = base[0] if x - base[0] < base[2] - x else base[2]
    else:
        game.zergling_y[z] = base[1] if y - base[1] < base[3] - y else base[3]


@kernel
def world_x(world: World, px: int) -> float:
    """Return x of the middle of a column of pixels, units."""
    return float(world.left + (px + 0.5) * world.pixel)


@kernel
def world_y(world: World, py: int) -> float:
    """Return y of the middle of a row of pixels, units; rows count downward."""
    return float(world.top - (py + 0.5) * world.pixel)


@kernel
def column_of(world: World, x: float) -> int:
    """Return the column of pixels that a place is in; it may be off the screen."""
    column: int = math.floor((x - world.left) / world.pixel)
    return column


@kernel
def row_of(world: World, y: float) -> int:
    """Return the row of pixels that a place is in; it may be off the screen."""
    row: int = math.floor((world.top - y) / world.pixel)
    return row


@kernel
def disc_covers(world: World, x: float, y: float, radius: float, px: int, py: int) -> bool:
    """Tell whether a unit's disc covers a pixel: its middle, or the disc's middle is in it."""
    dx, dy = world_x(world, px) - x, world_y(world, py) - y
    if dx * dx + dy * dy <= radius * radius + EDGE:
        return True
    return column_of(world, x) == px and row_of(world, y) == py


@kernel
def box_covers(world: World, x: float, y: float, half: float, px: int, py: int) -> bool:
    """Tell whether a structure's square covers the middle of a pixel."""
    reach = half + EDGE
    return abs(world_x(world, px) - x) <= reach and abs(world_y(world, py) - y) <= reach
