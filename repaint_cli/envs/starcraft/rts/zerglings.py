"""Where zerglings appear."""

import math

from repaint_cli.envs.starcraft.rts.constants import (
    HIDDEN,
    MARINES_APART,
    MAX_MARINES,
    MAX_ZERGLINGS,
    VISIBLE,
    ZERGLING,
    ZERGLINGS_APART,
)
from repaint_cli.envs.starcraft.rts.geometry import Game, World, chance, distance, inside
from repaint_cli.kernels import kernel

DRAWS = 200
"""Of a place with one distance to the others; then the distance is reduced."""
LEAST_APART, LESS_APART = 3.0, 0.5
"""The distance at the end, and by how much it is reduced, units."""
NEAR_RINGS = ((8.0, 9.0), (7.5, 9.5))
"""Radii between which the first two of FindAndDefeatZerglings appear, units. MAP."""
OTHERS_FROM = 10.5
"""Radius outside which its others do, units. MAP."""
EDGE = 1.0
"""None appears nearer to the edge of the map's region, units. MAP."""
BASE_MARGIN = 2.0
"""None appears nearer to the base, units."""


@kernel
def draw_place(game: Game, world: World, k: int, first: bool) -> tuple[float, float]:
    """Draw where the k-th zergling might appear."""
    region = world.region
    if first and not world.has_base and k < len(NEAR_RINGS):
        low, high = NEAR_RINGS[k]
        radius = low + (high - low) * chance(game)
        angle = 2.0 * math.pi * chance(game)
        x = (region[0] + region[2]) / 2.0 + radius * math.cos(angle)
        return x, (region[1] + region[3]) / 2.0 + radius * math.sin(angle)
    x = region[0] + EDGE + (region[2] - region[0] - 2.0 * EDGE) * chance(game)
    return x, region[1] + EDGE + (region[3] - region[1] - 2.0 * EDGE) * chance(game)


@kernel
def is_allowed(game: Game, world: World, k: int, first: bool, x: float, y: float) -> bool:
    """Tell whether the k-th zergling may appear in a place, whatever others are near.

    Where there is a base: outside it, and where nothing sees it; the first ones where nothing has
    yet seen. Else the first ones around the marines. Later ones keep away from marines.
    """
    if world.has_base:
        if inside(x, y, world.base, BASE_MARGIN):
            return False
        cell = game.visibility[int(y), int(x)]
        if world.fog and (cell == VISIBLE or (first and cell != HIDDEN)):
            return False
    elif first and k >= len(NEAR_RINGS):
        mx = (world.region[0] + world.region[2]) / 2.0
        my = (world.region[1] + world.region[3]) / 2.0
        if distance(x, y, mx, my) < OTHERS_FROM:
            return False
    if first:
        return True
    near = 0
    for m in range(MAX_MARINES):
        far = distance(x, y, game.marine_x[m], game.marine_y[m]) >= MARINES_APART
        near += game.marine_hp[m] > 0.0 and not far
    return near == 0


@kernel
def is_apart(game: Game, k: int, x: float, y: float, apart: float) -> bool:
    """Tell whether a place is at a distance from the first k zerglings."""
    near = 0
    for z in range(k):
        near += distance(x, y, game.zergling_x[z], game.zergling_y[z]) < apart
    return near == 0


@kernel
def place_zergling(game: Game, world: World, k: int, first: bool) -> None:
    """Find a place for the k-th zergling: 5 units from the others, or as near that as can be.

    If there is none even at 3 units, the last draw is taken that a zergling may stand in, or else
    the corner of the region.
    """
    bx, by, apart = world.region[0] + EDGE, world.region[1] + EDGE, ZERGLINGS_APART
    placed = False
    while not placed and apart >= LEAST_APART:
        for _ in range(DRAWS):
            x, y = draw_place(game, world, k, first)
            if not is_allowed(game, world, k, first, x, y):
                continue
            bx, by = x, y
            if is_apart(game, k, x, y, apart):
                placed = True
                break
        if not placed:
            apart -= LESS_APART
    if apart < ZERGLINGS_APART:
        game.placed_closer += 1
    game.zergling_x[k], game.zergling_y[k] = bx, by
    game.zergling_home_x[k], game.zergling_home_y[k] = bx, by
    game.zergling_hp[k] = ZERGLING.hit_points
    game.zergling_cooldown[k] = 0.0
    game.zergling_swing[k], game.zergling_target[k] = -1.0, -1


@kernel
def place_zerglings(game: Game, world: World) -> None:
    """Have all of a map's zerglings appear, at the start or when all are dead."""
    first = game.loop == 0
    if world.zerglings == 0 or not (first or world.respawn):
        return
    for z in range(MAX_ZERGLINGS):
        if game.zergling_hp[z] > 0.0:
            return
    for k in range(world.zerglings):
        place_zergling(game, world, k, first)
    if not first:
        game.respawns += 1
