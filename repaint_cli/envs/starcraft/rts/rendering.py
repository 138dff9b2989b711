"""The feature layers of a game: ground and fog, then its units, the smaller over the larger."""

import numpy as np

from repaint_cli.envs.starcraft.rts.constants import (
    BARRACKS,
    BARRACKS_TYPE,
    CENTRE_TYPE,
    COMMAND_CENTRE,
    DEPOT,
    DEPOT_TYPE,
    ENEMY,
    FOUNDATION,
    HIDDEN,
    MAP_SIZE,
    MARINE,
    MARINE_TYPE,
    MAX_BARRACKS,
    MAX_DEPOTS,
    MAX_MARINES,
    MAX_PATCHES,
    MAX_SCVS,
    MAX_ZERGLINGS,
    MINERAL_HIT_POINTS,
    MINERALS_TYPE,
    NEUTRAL,
    PATCH_HALF_HEIGHT,
    PATCH_HALF_WIDTH,
    SCREEN,
    SCV,
    SCV_TYPE,
    SELF,
    VISIBLE,
    ZERGLING,
    ZERGLING_TYPE,
)
from repaint_cli.envs.starcraft.rts.geometry import Game, World
from repaint_cli.envs.starcraft.rts.painting import Lens, paint_minimap, paint_screen
from repaint_cli.envs.starcraft.rts.state import (
    ABSENT,
    ONE_BARRACKS,
    ONE_DEPOT,
    ONE_SCV,
    THE_CENTRE,
)
from repaint_cli.kernels import kernel

OVERVIEW = Lens(0.0, float(MAP_SIZE), MAP_SIZE / SCREEN)
"""What the minimap shows: all of the map."""


MOST_FIGURES = 1 + MAX_PATCHES + MAX_DEPOTS + MAX_BARRACKS + MAX_SCVS + MAX_MARINES + MAX_ZERGLINGS


@kernel
def add(
    figures: np.ndarray, n: int, x: float, y: float, half_x: float, half_y: float, relative: int,
    kind: int, selected: bool, hp: float, most_hp: float,
) -> int:  # fmt: skip
    """Put a figure into the n-th row, and return n + 1."""
    figure = figures[n]
    figure[0], figure[1], figure[2], figure[3] = x, y, half_x, half_y
    figure[4], figure[5], figure[6] = relative, kind, selected
    figure[7], figure[8] = hp, most_hp
    return n + 1


@kernel
def cell_of(game: Game, x: float, y: float) -> int:
    """Return what is known of the cell that a place is in."""
    row = min(max(int(y), 0), MAP_SIZE - 1)
    return int(game.visibility[row, min(max(int(x), 0), MAP_SIZE - 1)])


@kernel
def grown_hit_points(game: Game, begun: int, done: int, most: float) -> float:
    """Return the hit points of a structure: a tenth when it is begun, all when it is done."""
    if done <= game.loop:
        return most
    grown = (1.0 - FOUNDATION) * (game.loop - begun) / (done - begun)
    return float(most * (FOUNDATION + grown))


@kernel
def paint_ground(game: Game, world: World, screen: np.ndarray, minimap: np.ndarray) -> None:
    """Fill all layers: the ground's height and the fog, and nothing else."""
    screen[0] = world.ground
    screen[2:] = 0
    minimap[1:] = 0
    for row in range(SCREEN):
        cell_row = world.cell_y[row]
        over_row = int((row + 0.5) * MAP_SIZE / SCREEN)
        for column in range(SCREEN):
            cell = world.cell_x[column]
            known = game.visibility[cell_row, cell] if cell_row >= 0 and cell >= 0 else HIDDEN
            screen[1, row, column] = known
            over = int((column + 0.5) * MAP_SIZE / SCREEN)
            minimap[0, row, column] = game.visibility[MAP_SIZE - 1 - over_row, over]


@kernel
def list_structures(game: Game, world: World, figures: np.ndarray) -> int:
    """List the patches that have minerals, the centre, depots and barracks; return how many."""
    n, r = 0, 0.0
    for p in range(world.patches):
        x, y = world.patch_x[p], world.patch_y[p]
        if game.patch_left[p] > 0 and cell_of(game, x, y) != HIDDEN:
            n = add(
                figures, n, x, y, PATCH_HALF_WIDTH, PATCH_HALF_HEIGHT, NEUTRAL, MINERALS_TYPE,
                False, MINERAL_HIT_POINTS, MINERAL_HIT_POINTS,
            )  # fmt: skip
    chosen, index = game.selected_kind, game.selected_index
    if world.has_base:
        r, most = COMMAND_CENTRE.radius, COMMAND_CENTRE.hit_points
        x, y = world.centre_x, world.centre_y
        n = add(figures, n, x, y, r, r, SELF, CENTRE_TYPE, chosen == THE_CENTRE, most, most)
    r, most = DEPOT.radius, DEPOT.hit_points
    for d in range(MAX_DEPOTS):
        if game.depot_done[d] > 0:
            x, y, selected = game.depot_x[d], game.depot_y[d], chosen == ONE_DEPOT and index == d
            hp = grown_hit_points(game, game.depot_begun[d], game.depot_done[d], most)
            n = add(figures, n, x, y, r, r, SELF, DEPOT_TYPE, selected, hp, most)
    r, most = BARRACKS.radius, BARRACKS.hit_points
    for b in range(MAX_BARRACKS):
        if game.barracks_done[b] > 0:
            x, y = game.barracks_x[b], game.barracks_y[b]
            selected = chosen == ONE_BARRACKS and index == b
            hp = grown_hit_points(game, game.barracks_begun[b], game.barracks_done[b], most)
            n = add(figures, n, x, y, r, r, SELF, BARRACKS_TYPE, selected, hp, most)
    return n


@kernel
def list_units(game: Game, figures: np.ndarray, n: int) -> int:
    """List SCVs, marines, and zerglings that are seen, from the n-th row on; return the end."""
    r, most = SCV.radius, SCV.hit_points
    for i in range(MAX_SCVS):
        if game.scv_state[i] != ABSENT:
            x, y = game.scv_x[i], game.scv_y[i]
            selected = game.selected_kind == ONE_SCV and game.selected_index == i
            n = add(figures, n, x, y, r, 0.0, SELF, SCV_TYPE, selected, most, most)
    r, most = MARINE.radius, MARINE.hit_points
    for m in range(MAX_MARINES):
        if game.marine_hp[m] > 0.0:
            x, y, hp = game.marine_x[m], game.marine_y[m], game.marine_hp[m]
            selected = game.marine_selected[m] > 0
            n = add(figures, n, x, y, r, 0.0, SELF, MARINE_TYPE, selected, hp, most)
    r, most = ZERGLING.radius, ZERGLING.hit_points
    for z in range(MAX_ZERGLINGS):
        x, y, hp = game.zergling_x[z], game.zergling_y[z], game.zergling_hp[z]
        if hp > 0.0 and cell_of(game, x, y) == VISIBLE:
            n = add(figures, n, x, y, r, 0.0, ENEMY, ZERGLING_TYPE, False, hp, most)
    return n


@kernel
def observe_rows(
    rows: np.ndarray, first: int, games: np.ndarray, worlds: np.ndarray, screen: np.ndarray,
    minimap: np.ndarray, measurements: np.ndarray, available: np.ndarray,
) -> None:  # fmt: skip
    """Fill what an agent sees of some games.

    Args:
        rows: which games, (K,).
        first: the place of the first of them in the arrays that are filled.
        games: all games, (N,).
        worlds: their map, (1,).
        screen: filled, (≥ first + K, 9, 84, 84).
        minimap: filled, (…, 3, 84, 84).
        measurements: filled, (…, 5).
        available: filled, (…, 7).
    """
    world = worlds[0]
    lens = Lens(world.left, world.top, world.pixel)
    figures = np.empty((MOST_FIGURES, 9))
    for k, row in enumerate(rows, first):
        game = games[row]
        paint_ground(game, world, screen[k], minimap[k])
        n = list_units(game, figures, list_structures(game, world, figures))
        for f in range(n):
            paint_screen(screen[k], lens, figures[f])
            paint_minimap(minimap[k], OVERVIEW, figures[f])
        measurements[k, 0], measurements[k, 1] = game.minerals, game.food_used
        measurements[k, 2], measurements[k, 3] = game.food_cap, game.food_workers
        measurements[k, 4] = game.army_count
        available[k] = game.available
