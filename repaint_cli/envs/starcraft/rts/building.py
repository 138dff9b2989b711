"""Structures: where they may stand, when an SCV begins one, and what comes of it."""

import math

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.starcraft.rts.constants import (
    BARRACKS,
    BARRACKS_BUILT,
    BUILD_DEPOT,
    COMMAND_CENTRE,
    DEPOT,
    MAP_SIZE,
    MAX_BARRACKS,
    MAX_DEPOTS,
    PATCH_HALF_HEIGHT,
    PATCH_HALF_WIDTH,
    SUPPLY_LIMIT,
    VISIBLE,
)
from repaint_cli.envs.starcraft.rts.geometry import Game, World, boxes_overlap, inside
from repaint_cli.kernels import kernel


@kernel
def half_of(kind: int) -> float:
    """Return half the side of the structure that a command builds, units."""
    return DEPOT.radius if kind == BUILD_DEPOT else BARRACKS.radius


@kernel
def snapped(place: float, kind: int) -> float:
    """Return the nearest coordinate that a structure's middle may have.

    A depot's two cells meet in it, a barracks' third is around it.
    """
    return math.floor(place + 0.5) if kind == BUILD_DEPOT else math.floor(place) + 0.5


@kernel
def is_blocked(game: Game, world: World, x: float, y: float, half: float) -> bool:
    """Tell whether a square overlaps a structure or a patch that has minerals."""
    if world.has_base and boxes_overlap(
        x, y, half, world.centre_x, world.centre_y, COMMAND_CENTRE.radius, COMMAND_CENTRE.radius
    ):
        return True
    for p in range(world.patches):
        if game.patch_left[p] > 0 and boxes_overlap(
            x, y, half, world.patch_x[p], world.patch_y[p], PATCH_HALF_WIDTH, PATCH_HALF_HEIGHT
        ):
            return True
    r = DEPOT.radius
    for d in range(MAX_DEPOTS):
        if game.depot_done[d] > 0 and boxes_overlap(
            x, y, half, game.depot_x[d], game.depot_y[d], r, r
        ):
            return True
    r = BARRACKS.radius
    for b in range(MAX_BARRACKS):
        if game.barracks_done[b] > 0 and boxes_overlap(
            x, y, half, game.barracks_x[b], game.barracks_y[b], r, r
        ):
            return True
    return False


@kernel
def is_site(game: Game, world: World, x: float, y: float, kind: int) -> bool:
    """Tell whether a structure may stand around a snapped middle.

    All of it is in the base, nothing is in its way, and its middle is visible.
    """
    half = half_of(kind)
    if not inside(x, y, world.base, -half):
        return False
    if not (0.0 <= x < MAP_SIZE and 0.0 <= y < MAP_SIZE):
        return False
    if game.visibility[int(y), int(x)] != VISIBLE:
        return False
    return not is_blocked(game, world, x, y, half)


@kernel
def has_depot(game: Game) -> bool:
    """Tell whether a depot is finished, which barracks require."""
    finished = 0
    for d in range(MAX_DEPOTS):
        finished += 0 < game.depot_done[d] <= game.loop
    return finished > 0


@kernel
def free_place(done: NDArray[np.int32]) -> int:
    """Return the first place of structures that is free, or −1, of when they are done, (K,)."""
    for k in range(len(done)):
        if done[k] == 0:
            return k
    return -1


@kernel
def begin_structure(game: Game, world: World, i: int) -> int:
    """Begin what an SCV has come to build, and pay.

    Returns:
        the loop at which it will be done; 0 when minerals are short or something is in the way.
    """
    x, y, kind = game.scv_site_x[i], game.scv_site_y[i], game.scv_site_kind[i]
    depot = kind == BUILD_DEPOT
    cost = DEPOT.cost if depot else BARRACKS.cost
    slot = free_place(game.depot_done) if depot else free_place(game.barracks_done)
    if game.minerals < cost or slot < 0 or is_blocked(game, world, x, y, half_of(kind)):
        return 0
    game.minerals -= cost
    game.minerals_spent += cost
    if depot:
        done = game.loop + DEPOT.build_loops
        game.depot_x[slot], game.depot_y[slot] = x, y
        game.depot_begun[slot], game.depot_done[slot] = game.loop, done
    else:
        done = game.loop + BARRACKS.build_loops
        game.barracks_x[slot], game.barracks_y[slot] = x, y
        game.barracks_begun[slot], game.barracks_done[slot] = game.loop, done
        game.barracks_queue[slot] = 0
        if world.award_on_order:
            game.phi[BARRACKS_BUILT] += 1
    return int(done)


@kernel
def finish_structure(game: Game, world: World, i: int) -> None:
    """Count what an SCV has finished; a depot gives supply."""
    if game.scv_site_kind[i] == BUILD_DEPOT:
        game.depots_built += 1
        game.food_cap = min(game.food_cap - DEPOT.supply, SUPPLY_LIMIT)
    else:
        game.barracks_built += 1
        if not world.award_on_order:
            game.phi[BARRACKS_BUILT] += 1
