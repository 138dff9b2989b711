"""SCVs dig and carry, build, and are trained; marines are trained. Times are loops.

An SCV does one thing until `scv_t1`, then the next: what it does is an event, not a movement. Times
of digging and walking keep their fractions, so that cycles have the length the data gives.
"""

import math

from repaint_cli.envs.starcraft.rts.building import begin_structure, finish_structure
from repaint_cli.envs.starcraft.rts.constants import (
    HANDOVER_LOOPS,
    MARINE,
    MAX_BARRACKS,
    MAX_SCVS,
    MINING_LOOPS,
    RETURN_LOOPS,
    SCV,
    SCV_TRAINED,
    TRIP_MINERALS,
)
from repaint_cli.envs.starcraft.rts.geometry import Game, World, distance, walk_loops
from repaint_cli.envs.starcraft.rts.recruits import new_marine
from repaint_cli.envs.starcraft.rts.state import (
    ABSENT,
    CONSTRUCTING,
    IDLE,
    MINING,
    RETURNING,
    TO_CENTRE,
    TO_PATCH,
    TO_SITE,
    WAITING,
)
from repaint_cli.kernels import kernel


@kernel
def walk(game: Game, i: int, state: int, x: float, y: float, since: float) -> None:
    """Have an SCV walk from where its last walk ended to a place, beginning at a time."""
    x0, y0 = game.scv_x1[i], game.scv_y1[i]
    game.scv_state[i] = state
    game.scv_x0[i], game.scv_y0[i], game.scv_x1[i], game.scv_y1[i] = x0, y0, x, y
    game.scv_t0[i], game.scv_t1[i] = since, since + walk_loops(distance(x0, y0, x, y))


@kernel
def stand(game: Game, i: int) -> None:
    """Have an SCV do nothing, where its last walk ended."""
    game.scv_state[i] = IDLE
    game.scv_x0[i], game.scv_y0[i] = game.scv_x1[i], game.scv_y1[i]
    game.scv_t0[i], game.scv_t1[i] = game.loop, math.inf


@kernel
def leave_patch(game: Game, i: int) -> None:
    """Take an SCV off its patch; if it was digging, the next one may begin now."""
    patch = game.scv_patch[i]
    if patch < 0:
        return
    game.patch_assigned[patch] -= 1
    game.scv_patch[i] = -1
    if game.scv_state[i] != MINING:
        return
    game.patch_free[patch] = game.loop
    for k in range(MAX_SCVS):
        if game.scv_state[k] == WAITING and game.scv_patch[k] == patch:
            game.scv_t1[k] = game.loop


@kernel
def choose_patch(game: Game, world: World, i: int) -> None:
    """Give an SCV the patch with minerals that has fewest SCVs, of these the nearest to home."""
    best = -1
    for p in range(world.patches):
        if game.patch_left[p] <= 0:
            continue
        fewer = best < 0 or game.patch_assigned[p] < game.patch_assigned[best]
        same = best >= 0 and game.patch_assigned[p] == game.patch_assigned[best]
        if fewer or (same and world.patch_way[p] < world.patch_way[best]):
            best = p
    game.scv_patch[i] = best
    if best >= 0:
        game.patch_assigned[best] += 1


@kernel
def mine(game: Game, world: World, i: int, since: float) -> None:
    """Send an SCV to its patch, or to another if that is empty, or nowhere if all are."""
    if game.scv_patch[i] >= 0 and game.patch_left[game.scv_patch[i]] <= 0:
        leave_patch(game, i)
    if game.scv_patch[i] < 0:
        choose_patch(game, world, i)
    patch = game.scv_patch[i]
    if patch < 0:
        stand(game, i)
    else:
        x, y = world.patch_dock_x[patch], world.patch_dock_y[patch]
        walk(game, i, TO_PATCH, x, y, since)


@kernel
def bring_home(game: Game, world: World, i: int, since: float) -> None:
    """Send an SCV to the centre with what it carries, to the dock of its patch or of the first."""
    patch = max(game.scv_patch[i], 0)
    walk(game, i, TO_CENTRE, world.home_dock_x[patch], world.home_dock_y[patch], since)


@kernel
def dig(game: Game, world: World, i: int, since: float) -> None:
    """Have an SCV at its patch dig, or wait for the one that does."""
    patch = game.scv_patch[i]
    if game.patch_left[patch] <= 0:
        mine(game, world, i, since)
    elif game.patch_free[patch] <= since:
        game.scv_state[i] = MINING
        game.scv_t1[i] = since + MINING_LOOPS
        game.patch_free[patch] = game.scv_t1[i] + HANDOVER_LOOPS
    else:
        game.scv_state[i] = WAITING
        game.scv_t1[i] = game.patch_free[patch]


@kernel
def resume(game: Game, world: World, i: int, since: float) -> None:
    """Have an SCV do what one does that has nothing to build: by an option it mines, or stands."""
    if not world.mines_after_build:
        stand(game, i)
    elif game.scv_carry[i] > 0:
        bring_home(game, world, i, since)
    else:
        mine(game, world, i, since)


@kernel
def next_of(game: Game, world: World, i: int) -> None:
    """Let an SCV, whose time has come, go on to what it does next."""
    state, time = game.scv_state[i], game.scv_t1[i]
    if state in (TO_PATCH, WAITING):
        dig(game, world, i, time)
    elif state == MINING:
        patch = game.scv_patch[i]
        game.scv_carry[i] = min(TRIP_MINERALS, game.patch_left[patch])
        game.patch_left[patch] -= game.scv_carry[i]
        game.scv_state[i], game.scv_t1[i] = RETURNING, time + RETURN_LOOPS
    elif state == RETURNING:
        bring_home(game, world, i, time)
    elif state == TO_CENTRE:
        game.minerals += game.scv_carry[i]
        game.minerals_mined += game.scv_carry[i]
        game.scv_carry[i] = 0
        mine(game, world, i, time)
    elif state == TO_SITE:
        done = begin_structure(game, world, i)
        if done > 0:
            game.scv_state[i], game.scv_t1[i] = CONSTRUCTING, done
        else:
            resume(game, world, i, time)
    elif state == CONSTRUCTING:
        finish_structure(game, world, i)
        resume(game, world, i, time)


@kernel
def new_scv(game: Game, world: World) -> None:
    """Put an SCV at the centre's edge; it mines by itself."""
    for i in range(MAX_SCVS):
        if game.scv_state[i] == ABSENT:
            game.scv_state[i] = IDLE
            game.scv_patch[i], game.scv_carry[i] = -1, 0
            choose_patch(game, world, i)
            dock = max(game.scv_patch[i], 0)
            game.scv_x1[i], game.scv_y1[i] = world.home_dock_x[dock], world.home_dock_y[dock]
            mine(game, world, i, game.loop)
            game.food_workers += 1
            return


@kernel
def work(game: Game, world: World) -> None:
    """Do what is due by the game's loop: SCVs, then what the centre and barracks train."""
    for i in range(MAX_SCVS):
        while game.scv_state[i] > IDLE and game.scv_t1[i] <= game.loop:
            next_of(game, world, i)
    if game.centre_queue > 0 and game.centre_head <= game.loop:
        new_scv(game, world)
        game.scvs_trained += 1
        game.centre_queue -= 1
        game.centre_head += SCV.build_loops
        if not world.award_on_order:
            game.phi[SCV_TRAINED] += 1
    for b in range(MAX_BARRACKS):
        if game.barracks_queue[b] > 0 and game.barracks_head[b] <= game.loop:
            new_marine(game, world, b)
            game.barracks_queue[b] -= 1
            game.barracks_head[b] += MARINE.build_loops
