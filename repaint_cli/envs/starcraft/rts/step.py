"""One step of many games: a command, eight loops, and what is seen and can be done after them."""

import numpy as np

from repaint_cli.envs.starcraft.rts.combat import fight
from repaint_cli.envs.starcraft.rts.commands import obey
from repaint_cli.envs.starcraft.rts.constants import (
    COMMAND_CENTRE,
    LOOPS_PER_STEP,
    MAP_SIZE,
    MAX_SCVS,
    START_COLUMNS,
    START_MINERALS,
    START_ROWS,
)
from repaint_cli.envs.starcraft.rts.crowd import make_room
from repaint_cli.envs.starcraft.rts.economy import choose_patch, mine, work
from repaint_cli.envs.starcraft.rts.fog import lift_fog
from repaint_cli.envs.starcraft.rts.geometry import Game, World, chance, place_scv
from repaint_cli.envs.starcraft.rts.recruits import first_marines
from repaint_cli.envs.starcraft.rts.selection import update_available
from repaint_cli.envs.starcraft.rts.state import ABSENT, IDLE, MARINES
from repaint_cli.envs.starcraft.rts.zerglings import place_zerglings, respawn
from repaint_cli.kernels import kernel


@kernel
def place_scvs(game: Game) -> None:
    """Put every SCV where its walk has brought it."""
    for i in range(MAX_SCVS):
        if game.scv_state[i] != ABSENT:
            place_scv(game, i)


@kernel
def first_scvs(game: Game, world: World) -> None:
    """Put a base's SCVs, and send them to mine.

    The first twelve stand to the left or to the right of the centre, by chance; others at its edge.
    """
    side = 1.0 if chance(game) < 0.5 else -1.0
    for i in range(world.start_scvs):
        game.scv_state[i] = IDLE
        choose_patch(game, world, i)
        column, row = i // len(START_ROWS), i % len(START_ROWS)
        if column < len(START_COLUMNS):
            game.scv_x1[i] = world.centre_x + side * START_COLUMNS[column]
            game.scv_y1[i] = world.centre_y + START_ROWS[row]
        else:
            dock = max(game.scv_patch[i], 0)
            game.scv_x1[i], game.scv_y1[i] = world.home_dock_x[dock], world.home_dock_y[dock]
        mine(game, world, i, game.loop)
        game.food_workers += 1
        game.food_used += 1


@kernel
def begin(game: Game, world: World, seed: int) -> None:
    """Begin a game, whose record is all zeros."""
    game.rng = np.uint64(seed)
    game.selected_index, game.last_command = -1, -1
    game.scv_patch[:] = -1
    game.marine_target[:] = -1
    game.zergling_target[:] = -1
    game.zergling_swing[:] = -1.0
    if world.has_base:
        game.minerals, game.food_cap = START_MINERALS, -COMMAND_CENTRE.supply
        game.patch_left[: world.patches] = world.minerals
        first_scvs(game, world)
    if world.marines > 0:
        first_marines(game, world)
        game.selected_kind = MARINES
    place_scvs(game)
    lift_fog(game, world)
    place_zerglings(game, world, True)
    update_available(game, world)


@kernel
def step(game: Game, world: World, action: np.ndarray, cells: np.ndarray) -> None:
    """Let a game go on by eight loops, after an action.

    Args:
        game: changed.
        world: its map.
        action: command, x and y, (3,).
        cells: room for `make_room`, filled with −1, (64, 64).
    """
    game.phi[:] = 0.0
    obey(game, world, action[0], action[1], action[2])
    for _ in range(LOOPS_PER_STEP):
        if world.zerglings > 0:
            fight(game, world)
        game.loop += 1
        if world.has_base:
            work(game, world)
        if game.loop >= world.loops:
            break
    make_room(game, world, cells)
    place_scvs(game)
    if world.fog:
        lift_fog(game, world)
    respawn(game, world)
    update_available(game, world)
    game.terminated = world.ends_without_marines and game.army_count == 0
    game.truncated = not game.terminated and game.loop >= world.loops


@kernel
def step_rows(rows: np.ndarray, games: np.ndarray, worlds: np.ndarray, actions: np.ndarray) -> None:
    """Let some games go on; `rows` (K,) are row numbers of `games` (N,) and `actions` (N, 3)."""
    cells = np.full((MAP_SIZE, MAP_SIZE), -1, np.int16)
    for row in rows:
        step(games[row], worlds[0], actions[row], cells)


@kernel
def begin_rows(rows: np.ndarray, games: np.ndarray, worlds: np.ndarray, seeds: np.ndarray) -> None:
    """Begin some games; `rows` (K,) are row numbers of `games` (N,), whose records are zeros."""
    for k, row in enumerate(rows):
        begin(games[row], worlds[0], seeds[k])
