"""What the seven commands do."""

from repaint_cli.envs.starcraft.rts.building import half_of, is_site, snapped
from repaint_cli.envs.starcraft.rts.constants import (
    ATTACK_POINT,
    BUILD_BARRACKS,
    BUILD_DEPOT,
    MARINE,
    MARINE_BUILT,
    MAX_MARINES,
    SCV,
    SCV_TRAINED,
    SELECT_ARMY,
    SELECT_HIT,
    SELECT_MISS,
    SELECT_POINT,
    TRAIN_MARINE,
    TRAIN_SCV,
    UNAVAILABLE,
)
from repaint_cli.envs.starcraft.rts.economy import leave_patch, walk
from repaint_cli.envs.starcraft.rts.geometry import (
    Game,
    World,
    place_scv,
    world_x,
    world_y,
)
from repaint_cli.envs.starcraft.rts.selection import select_army, select_point
from repaint_cli.envs.starcraft.rts.state import ATTACK_MOVE, TO_SITE
from repaint_cli.kernels import kernel

CROWD = 0.4
"""Marines sent together stop within this times √(how many) of the place, units: it is full."""


@kernel
def order_to_build(game: Game, world: World, kind: int, px: int, py: int) -> bool:
    """Send the selected SCV to build around a pixel.

    It pays when it arrives, at the edge of the site that is on its way.

    Returns:
        whether the structure may stand there; if not, nothing happens.
    """
    x, y = snapped(world_x(world, px), kind), snapped(world_y(world, py), kind)
    if not is_site(game, world, x, y, kind):
        return False
    i = game.selected_index
    leave_patch(game, i)
    place_scv(game, i)
    game.scv_x1[i], game.scv_y1[i] = game.scv_x[i], game.scv_y[i]
    game.scv_site_kind[i], game.scv_site_x[i], game.scv_site_y[i] = kind, x, y
    dx, dy = game.scv_x[i] - x, game.scv_y[i] - y
    half = half_of(kind) + SCV.radius
    beyond = max(abs(dx), abs(dy))
    share = half / beyond if beyond > half else 1.0  # of the way back from the middle
    walk(game, i, TO_SITE, x + share * dx, y + share * dy, game.loop)
    return True


@kernel
def train_scv(game: Game, world: World) -> None:
    """Have the centre train an SCV, or put it into its queue; it is paid for, and fed, at once."""
    game.minerals -= SCV.cost
    game.minerals_spent += SCV.cost
    game.food_used += SCV.supply
    if game.centre_queue == 0:
        game.centre_head = game.loop + SCV.build_loops
    game.centre_queue += 1
    if world.award_on_order:
        game.phi[SCV_TRAINED] += 1


@kernel
def train_marine(game: Game, world: World) -> None:
    """Have the selected barracks train a marine, or put it into their queue; see `train_scv`."""
    b = game.selected_index
    game.minerals -= MARINE.cost
    game.minerals_spent += MARINE.cost
    game.food_used += MARINE.supply
    if game.barracks_queue[b] == 0:
        game.barracks_head[b] = game.loop + MARINE.build_loops
    game.barracks_queue[b] += 1
    if world.award_on_order:
        game.phi[MARINE_BUILT] += 1


@kernel
def attack_point(game: Game, world: World, px: int, py: int) -> None:
    """Send the selected marines to a pixel, as far as the map goes; they fight on the way."""
    region, r = world.region, MARINE.radius
    x = min(max(world_x(world, px), region[0] + r), region[2] - r)
    y = min(max(world_y(world, py), region[1] + r), region[3] - r)
    many = 0
    for m in range(MAX_MARINES):
        many += game.marine_selected[m]
    for m in range(MAX_MARINES):
        if game.marine_selected[m]:
            game.marine_order[m] = ATTACK_MOVE
            game.marine_goal_x[m], game.marine_goal_y[m] = x, y
            game.marine_goal_reach[m] = CROWD * many**0.5


@kernel
def carry_out(game: Game, world: World, command: int, px: int, py: int) -> bool:
    """Do what an available command says; return whether it was refused for its place."""
    if command in (BUILD_DEPOT, BUILD_BARRACKS):
        legal = order_to_build(game, world, command, px, py)
        return not legal and world.illegal_is_unavailable > 0
    if command == TRAIN_SCV:
        train_scv(game, world)
    elif command == TRAIN_MARINE:
        train_marine(game, world)
    elif command == SELECT_POINT:
        hit = select_point(game, world, px, py)
        game.phi[SELECT_HIT if hit else SELECT_MISS] += 1
    elif command == ATTACK_POINT:
        attack_point(game, world, px, py)
    elif command == SELECT_ARMY:
        select_army(game)
    return False


@kernel
def obey(game: Game, world: World, command: int, px: int, py: int) -> None:
    """Do what a command says, if it is available; else only the term `unavailable` counts it."""
    refused = game.available[command] == 0 or carry_out(game, world, command, px, py)
    if refused:
        game.phi[UNAVAILABLE] += 1
    game.last_command, game.last_x, game.last_y = command, px, py
    game.last_refused = refused
