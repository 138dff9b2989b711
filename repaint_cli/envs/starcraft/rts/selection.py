"""What is selected, and which commands are available because of it."""

from repaint_cli.envs.starcraft.rts.building import free_place, has_depot
from repaint_cli.envs.starcraft.rts.constants import (
    ATTACK_POINT,
    BARRACKS,
    BUILD_BARRACKS,
    BUILD_DEPOT,
    COMMAND_CENTRE,
    DEPOT,
    MARINE,
    MAX_BARRACKS,
    MAX_DEPOTS,
    MAX_MARINES,
    MAX_SCVS,
    QUEUE,
    SCV,
    SELECT_ARMY,
    SELECT_POINT,
    TRAIN_MARINE,
    TRAIN_SCV,
)
from repaint_cli.envs.starcraft.rts.geometry import (
    Game,
    World,
    box_covers,
    disc_covers,
    world_x,
    world_y,
)
from repaint_cli.envs.starcraft.rts.state import (
    ABSENT,
    CONSTRUCTING,
    MARINES,
    NOTHING,
    ONE_BARRACKS,
    ONE_DEPOT,
    ONE_SCV,
    THE_CENTRE,
)
from repaint_cli.kernels import kernel


@kernel
def unit_at(game: Game, world: World, px: int, py: int) -> tuple[int, int]:
    """Return kind and place of the SCV or marine that a pixel shows, of several the nearest."""
    kind, index, nearest = NOTHING, -1, 1e30
    wx, wy = world_x(world, px), world_y(world, py)
    for i in range(MAX_SCVS):
        if game.scv_state[i] != ABSENT:
            x, y = game.scv_x[i], game.scv_y[i]
            far = (x - wx) * (x - wx) + (y - wy) * (y - wy)
            if far < nearest and disc_covers(world, x, y, SCV.radius, px, py):
                kind, index, nearest = ONE_SCV, i, far
    for m in range(MAX_MARINES):
        if game.marine_hp[m] > 0.0:
            x, y = game.marine_x[m], game.marine_y[m]
            far = (x - wx) * (x - wx) + (y - wy) * (y - wy)
            if far < nearest and disc_covers(world, x, y, MARINE.radius, px, py):
                kind, index, nearest = MARINES, m, far
    return kind, index


@kernel
def structure_at(game: Game, world: World, px: int, py: int) -> tuple[int, int]:
    """Return kind and place of the structure that a pixel shows; they never overlap."""
    if world.has_base and box_covers(
        world, world.centre_x, world.centre_y, COMMAND_CENTRE.radius, px, py
    ):
        return THE_CENTRE, 0
    for b in range(MAX_BARRACKS):
        if game.barracks_done[b] > 0 and box_covers(
            world, game.barracks_x[b], game.barracks_y[b], BARRACKS.radius, px, py
        ):
            return ONE_BARRACKS, b
    for d in range(MAX_DEPOTS):
        if game.depot_done[d] > 0 and box_covers(
            world, game.depot_x[d], game.depot_y[d], DEPOT.radius, px, py
        ):
            return ONE_DEPOT, d
    return NOTHING, -1


@kernel
def select_point(game: Game, world: World, px: int, py: int) -> bool:
    """Select what a pixel shows of one's own, units before structures.

    Returns:
        whether there was something; if not, the selection stays.
    """
    kind, index = unit_at(game, world, px, py)
    if kind == NOTHING:
        kind, index = structure_at(game, world, px, py)
    if kind == NOTHING:
        return False
    game.selected_kind, game.selected_index = kind, index
    game.marine_selected[:] = 0
    if kind == MARINES:
        game.marine_selected[index] = 1
    return True


@kernel
def select_army(game: Game) -> None:
    """Select all marines."""
    game.selected_kind, game.selected_index = MARINES, -1
    for m in range(MAX_MARINES):
        game.marine_selected[m] = game.marine_hp[m] > 0.0


@kernel
def update_available(game: Game, world: World) -> None:
    """Fill which commands are available now.

    Building needs an SCV selected that is not constructing, and the minerals; barracks need a
    finished depot. Training needs the centre or finished barracks selected, minerals, supply, and
    room in the queue. Marines can be selected and sent only where there are zerglings.
    """
    kind, index = game.selected_kind, game.selected_index
    builder = kind == ONE_SCV and game.scv_state[index] != CONSTRUCTING
    supply = game.food_used < game.food_cap
    fights = world.zerglings > 0
    room = game.food_workers + game.centre_queue < MAX_SCVS
    can = game.available
    can[BUILD_DEPOT] = builder and game.minerals >= DEPOT.cost and free_place(game.depot_done) >= 0
    can[BUILD_BARRACKS] = (
        builder
        and game.minerals >= BARRACKS.cost
        and has_depot(game)
        and free_place(game.barracks_done) >= 0
    )
    can[TRAIN_SCV] = (
        kind == THE_CENTRE
        and game.minerals >= SCV.cost
        and game.centre_queue < QUEUE
        and supply
        and room
    )
    can[TRAIN_MARINE] = (
        kind == ONE_BARRACKS
        and game.barracks_done[index] <= game.loop
        and game.minerals >= MARINE.cost
        and game.barracks_queue[index] < QUEUE
        and supply
    )
    can[SELECT_POINT] = 1
    can[ATTACK_POINT] = fights and kind == MARINES
    can[SELECT_ARMY] = fights and game.army_count > 0
