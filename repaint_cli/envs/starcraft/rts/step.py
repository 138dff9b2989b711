"""One step of many games: a command, eight loops, and what is seen and can be done after them."""

import numpy as np
from numpy.typing import NDArray

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
from repaint_cli.envs.starcraft.rts.state import ABSENT, IDLE, MARINES, bytes_of
from repaint_cli.envs.starcraft.rts.zerglings import place_zerglings
from repaint_cli.kernels import kernel


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
def begin_rows(rows: np.ndarray, games: np.ndarray, worlds: np.ndarray, seeds: np.ndarray) -> None:
    """Put the first units of some games, whose records are zeros; `settle_rows` does the rest.

    Args:
        rows: which games, (K,) row numbers of `games`.
        games: all games, (N,).
        worlds: their map, (1,).
        seeds: of these games, (K,).
    """
    world = worlds[0]
    for k, row in enumerate(rows):
        game = games[row]
        game.rng = np.uint64(seeds[k])
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


@kernel
def obey_rows(rows: np.ndarray, games: np.ndarray, worlds: np.ndarray, actions: np.ndarray) -> None:
    """Begin a step of some games (K,) with a command; `actions` (N, 3) are command, x and y."""
    for row in rows:
        games[row].phi[:] = 0.0
        obey(games[row], worlds[0], actions[row, 0], actions[row, 1], actions[row, 2])


@kernel
def fight_rows(rows: np.ndarray, games: np.ndarray, worlds: np.ndarray) -> None:
    """Let the marines and zerglings of some games (K,) act for the loops of a step."""
    for row in rows:
        loop = games[row].loop
        for k in range(loop, min(loop + LOOPS_PER_STEP, worlds[0].loops)):
            fight(games[row], worlds[0], k)


@kernel
def work_rows(rows: np.ndarray, games: np.ndarray, worlds: np.ndarray) -> None:
    """Let the clocks of some games (K,) run for a step, and what is due in their bases happen."""
    for row in rows:
        game = games[row]
        for _ in range(min(LOOPS_PER_STEP, worlds[0].loops - game.loop)):
            game.loop += 1
            if worlds[0].has_base:
                work(game, worlds[0])


@kernel
def settle_rows(rows: np.ndarray, games: np.ndarray, worlds: np.ndarray) -> None:
    """End a step of some games (K,): places, fog, zerglings that appear, what can be done now."""
    world = worlds[0]
    cells = np.full((MAP_SIZE, MAP_SIZE), -1, np.int16)
    for row in rows:
        game = games[row]
        make_room(game, world, cells)
        for i in range(MAX_SCVS):
            if game.scv_state[i] != ABSENT:
                place_scv(game, i)
        if world.fog or game.loop == 0:
            lift_fog(game, world)
        place_zerglings(game, world)
        update_available(game, world)
        game.terminated = world.ends_without_marines and game.army_count == 0
        game.truncated = not game.terminated and game.loop >= world.loops


def begin_games(
    rows: NDArray[np.int64], games: NDArray[np.void], world: NDArray[np.void],
    seeds: NDArray[np.int64],
) -> None:  # fmt: skip
    """Begin some games anew; see `begin_rows`."""
    bytes_of(games)[rows] = 0
    begin_rows(rows, games, world, seeds)
    settle_rows(rows, games, world)


def step_games(
    rows: NDArray[np.int64], games: NDArray[np.void], world: NDArray[np.void],
    actions: NDArray[np.int16],
) -> None:  # fmt: skip
    """Let some games go on by a step; see `obey_rows`.

    Fights and work do not touch each other within a step: a marine that is trained joins at its
    end. So each is a kernel, which compiles in half the time.
    """
    obey_rows(rows, games, world, actions)
    if world["zerglings"][0] > 0:
        fight_rows(rows, games, world)
    work_rows(rows, games, world)
    settle_rows(rows, games, world)
