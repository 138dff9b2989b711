"""Where trained marines appear, and the first units of a map."""

import math

import numpy as np

from repaint_cli.envs.starcraft.rts.building import is_blocked
from repaint_cli.envs.starcraft.rts.constants import (
    BARRACKS,
    MARINE,
    MARINE_BUILT,
    MAX_MARINES,
    MAX_ZERGLINGS,
)
from repaint_cli.envs.starcraft.rts.geometry import Game, World, inside
from repaint_cli.kernels import kernel

_SPACE = 0.8


def _slots() -> np.ndarray:
    """Return places below barracks for marines, from their middle, the nearest first, (63, 2)."""
    below = BARRACKS.radius + MARINE.radius + 0.05
    slots = [(k * _SPACE, -below - row * _SPACE) for row in range(7) for k in range(-4, 5)]
    return np.array(sorted(slots, key=lambda slot: (slot[0] ** 2 + slot[1] ** 2, slot)))


SLOTS = _slots()
"""Places where a marine may appear, from the middle of its barracks, the nearest first, units."""


@kernel
def is_crowded(game: Game, x: float, y: float) -> bool:
    """Tell whether a marine in this place would touch another."""
    for m in range(MAX_MARINES):
        if game.marine_hp[m] > 0.0:
            dx, dy = game.marine_x[m] - x, game.marine_y[m] - y
            if dx * dx + dy * dy < 4.0 * MARINE.radius * MARINE.radius:
                return True
    return False


@kernel
def put_marine(game: Game, x: float, y: float) -> None:
    """Put a fresh marine in a place; who was after the dead one that it follows is not after it."""
    for m in range(MAX_MARINES):
        if game.marine_hp[m] <= 0.0:
            game.marine_x[m], game.marine_y[m] = x, y
            game.marine_hp[m], game.marine_cooldown[m] = MARINE.hit_points, 0.0
            game.marine_order[m], game.marine_target[m], game.marine_selected[m] = 0, -1, 0
            game.army_count += 1
            for z in range(MAX_ZERGLINGS):
                if game.zergling_target[z] == m:
                    game.zergling_target[z] = -1
            return


@kernel
def new_marine(game: Game, world: World, b: int) -> None:
    """Put a trained marine into the nearest free place below its barracks."""
    x, y = game.barracks_x[b] + SLOTS[0, 0], game.barracks_y[b] + SLOTS[0, 1]
    for k in range(len(SLOTS)):
        sx, sy = game.barracks_x[b] + SLOTS[k, 0], game.barracks_y[b] + SLOTS[k, 1]
        if not inside(sx, sy, world.region, -MARINE.radius):
            continue
        if is_blocked(game, world, sx, sy, MARINE.radius) or is_crowded(game, sx, sy):
            continue
        x, y = sx, sy
        break
    put_marine(game, x, y)
    game.marines_built += 1
    if not world.award_on_order:
        game.phi[MARINE_BUILT] += 1


@kernel
def first_marines(game: Game, world: World) -> None:
    """Put a map's marines, selected, on a circle of radius 1 around its middle."""
    for m in range(world.marines):
        angle = 2.0 * math.pi * m / world.marines
        x = (world.region[0] + world.region[2]) / 2.0 + math.cos(angle)
        y = (world.region[1] + world.region[3]) / 2.0 + math.sin(angle)
        put_marine(game, x, y)
        game.marine_selected[m] = 1
        game.food_used += 1
