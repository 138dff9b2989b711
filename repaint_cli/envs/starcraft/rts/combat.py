"""Marines and zerglings find each other, come near, and fight, a loop at a time.

In a loop the marines act first, then the zerglings; among each other in an order that shifts by one
place a loop. Each keeps the fraction of a loop by which its last blow came late. Zerglings fight
marines alone, and never enter the base: what they cannot reach from its border they let be.
"""

from repaint_cli.envs.starcraft.rts.constants import (
    CLAWS,
    HELP_RADIUS,
    LEASH,
    LEAST_DAMAGE,
    MARINE,
    MARINE_DIED,
    MAX_MARINES,
    MAX_ZERGLINGS,
    RIFLE,
    SCAN_EVERY,
    ZERGLING,
    ZERGLING_KILLED,
)
from repaint_cli.envs.starcraft.rts.geometry import Game, World, chance, distance, inside, keep_out
from repaint_cli.envs.starcraft.rts.state import ATTACK_MOVE, MARINES, NO_ORDER, NOTHING
from repaint_cli.kernels import kernel

_BODIES = MARINE.radius + ZERGLING.radius
SHOT = RIFLE.range + _BODIES
"""A marine hits a zergling whose middle is within this of its own, units."""
BITE = CLAWS.range + _BODIES
"""The same of a zergling."""
NESTLE = 0.02
"""A zergling comes this much nearer than it must, units."""
MARINE_SCAN, ZERGLING_SCAN = RIFLE.scan + _BODIES, CLAWS.scan + _BODIES
"""They acquire a target within this, middle to middle, units."""


@kernel
def ready_again(game: Game, world: World, cooldown: float, period: float) -> float:
    """Return the loops until the next blow, after one that came at a cooldown of 0 or less."""
    delay = world.delay_low
    if world.delay_high > world.delay_low:
        delay += (world.delay_high - world.delay_low) * chance(game)
    return float(cooldown + period + delay)


@kernel
def is_reachable(game: Game, world: World, m: int) -> bool:
    """Tell whether a zergling can bite a marine without entering the base."""
    if not world.has_base:
        return True
    return not inside(game.marine_x[m], game.marine_y[m], world.base, -BITE)


@kernel
def provoke(game: Game, world: World, z: int, m: int) -> None:
    """Turn a zergling that has no target, and those near it, against the marine that hit it."""
    if not is_reachable(game, world, m):
        return
    for k in range(MAX_ZERGLINGS):
        if game.zergling_hp[k] > 0.0 and game.zergling_target[k] < 0:
            x, y = game.zergling_x[k], game.zergling_y[k]
            if distance(x, y, game.zergling_x[z], game.zergling_y[z]) <= HELP_RADIUS:
                game.zergling_target[k] = m


@kernel
def shoot(game: Game, world: World, m: int, z: int) -> None:
    """Have a marine hit a zergling."""
    game.zergling_hp[z] -= max(RIFLE.damage - ZERGLING.armour, LEAST_DAMAGE)
    if game.zergling_hp[z] > 0.0:
        provoke(game, world, z, m)
        return
    game.zergling_hp[z] = 0.0
    game.zerglings_killed += 1
    game.phi[ZERGLING_KILLED] += 1


@kernel
def bite(game: Game, m: int) -> None:
    """Have a zergling hit a marine."""
    game.marine_hp[m] -= max(CLAWS.damage - MARINE.armour, LEAST_DAMAGE)
    if game.marine_hp[m] > 0.0:
        return
    game.marine_hp[m] = 0.0
    game.marine_selected[m] = 0
    game.army_count -= 1
    game.food_used -= MARINE.supply
    game.marines_died += 1
    game.phi[MARINE_DIED] += 1
    if game.selected_kind == MARINES and not game.marine_selected.any():
        game.selected_kind = NOTHING


@kernel
def nearest_zergling(game: Game, x: float, y: float) -> int:
    """Return the zergling nearest to a marine here that it acquires, or −1."""
    best, nearest = -1, MARINE_SCAN * MARINE_SCAN
    for z in range(MAX_ZERGLINGS):
        dx = game.zergling_x[z] - x
        if abs(dx) <= MARINE_SCAN and game.zergling_hp[z] > 0.0:
            dy = game.zergling_y[z] - y
            if dx * dx + dy * dy < nearest or (best < 0 and dx * dx + dy * dy <= nearest):
                best, nearest = z, dx * dx + dy * dy
    return best


@kernel
def nearest_marine(game: Game, world: World, x: float, y: float, marines: int) -> int:
    """Return which of the first so many marines a zergling here acquires, the nearest, or −1."""
    best, nearest = -1, ZERGLING_SCAN * ZERGLING_SCAN
    for m in range(marines):
        dx = game.marine_x[m] - x
        if abs(dx) <= ZERGLING_SCAN and game.marine_hp[m] > 0.0:
            dy = game.marine_y[m] - y
            closer = dx * dx + dy * dy < nearest or (best < 0 and dx * dx + dy * dy <= nearest)
            if closer and is_reachable(game, world, m):
                best, nearest = m, dx * dx + dy * dy
    return best


@kernel
def march(game: Game, m: int, x: float, y: float) -> None:
    """Move a marine a loop's way towards a place."""
    way = distance(game.marine_x[m], game.marine_y[m], x, y)
    share = MARINE.speed / way if way > MARINE.speed else 1.0
    game.marine_x[m] += share * (x - game.marine_x[m])
    game.marine_y[m] += share * (y - game.marine_y[m])


@kernel
def act_marine(game: Game, world: World, m: int, loop: int) -> None:
    """Let a marine shoot, or walk: one that has no order holds its place.

    A target out of its range it gives up at the next scan for the nearest one.
    """
    game.marine_cooldown[m] = max(game.marine_cooldown[m] - 1.0, -1.0)
    x, y, z = game.marine_x[m], game.marine_y[m], game.marine_target[m]
    way = 1e30
    if z >= 0 and game.zergling_hp[z] > 0.0:
        way = distance(x, y, game.zergling_x[z], game.zergling_y[z])
    else:
        z = -1
    if way > SHOT and loop % SCAN_EVERY == 0:
        z = nearest_zergling(game, x, y)
        if z >= 0:
            way = distance(x, y, game.zergling_x[z], game.zergling_y[z])
    game.marine_target[m] = z
    if z >= 0 and way <= SHOT:
        if game.marine_cooldown[m] <= 0.0:
            cooldown = ready_again(game, world, game.marine_cooldown[m], RIFLE.period)
            game.marine_cooldown[m] = cooldown
            shoot(game, world, m, z)
    elif game.marine_order[m] == ATTACK_MOVE:
        if z >= 0:
            march(game, m, game.zergling_x[z], game.zergling_y[z])
            return
        gx, gy = game.marine_goal_x[m], game.marine_goal_y[m]
        march(game, m, gx, gy)
        if distance(game.marine_x[m], game.marine_y[m], gx, gy) <= game.marine_goal_reach[m]:
            game.marine_order[m] = NO_ORDER


@kernel
def run_to(game: Game, world: World, z: int, x: float, y: float, stop: float) -> None:
    """Move a zergling a loop's way towards a place, to within a distance of it; not into the base.

    At the base's border it stays on the side that it is nearest to.
    """
    way = distance(game.zergling_x[z], game.zergling_y[z], x, y)
    go = min(ZERGLING.speed, way - stop)
    if go <= 0.0:
        return
    x = game.zergling_x[z] + go / way * (x - game.zergling_x[z])
    y = game.zergling_y[z] + go / way * (y - game.zergling_y[z])
    game.zergling_x[z], game.zergling_y[z] = x, y
    keep_out(game, world, z)


@kernel
def has_target(game: Game, world: World, z: int) -> bool:
    """Tell whether a zergling's target lives, and neither the base nor its leash protects it."""
    m = game.zergling_target[z]
    if m < 0 or game.marine_hp[m] <= 0.0 or not is_reachable(game, world, m):
        return False
    hx, hy = game.zergling_home_x[z], game.zergling_home_y[z]
    return distance(game.zergling_x[z], game.zergling_y[z], hx, hy) <= LEASH


@kernel
def swing_on(game: Game, z: int) -> None:
    """Let a blow of a zergling, which stands meanwhile, come a loop nearer to its end."""
    game.zergling_swing[z] -= 1.0
    if game.zergling_swing[z] > 0.0:
        return
    game.zergling_swing[z] = -1.0
    m = game.zergling_target[z]
    if m >= 0 and game.marine_hp[m] > 0.0:
        bite(game, m)


@kernel
def act_zergling(game: Game, world: World, z: int, loop: int, marines: int) -> None:
    """Let a zergling heal, and bite, run to its target, or go home; see `nearest_marine`."""
    game.zergling_hp[z] = min(game.zergling_hp[z] + world.regeneration, ZERGLING.hit_points)
    game.zergling_cooldown[z] = max(game.zergling_cooldown[z] - 1.0, -1.0)
    if game.zergling_swing[z] >= 0.0:
        swing_on(game, z)
        return
    x, y = game.zergling_x[z], game.zergling_y[z]
    if not has_target(game, world, z):
        game.zergling_target[z] = -1
    m = game.zergling_target[z]
    way = 1e30 if m < 0 else distance(x, y, game.marine_x[m], game.marine_y[m])
    if way > BITE and loop % SCAN_EVERY == 0:
        near = nearest_marine(game, world, x, y, marines)
        if near >= 0:
            m, game.zergling_target[z] = near, near
            way = distance(x, y, game.marine_x[m], game.marine_y[m])
    if m < 0:
        run_to(game, world, z, game.zergling_home_x[z], game.zergling_home_y[z], 0.0)
    elif way > BITE:
        run_to(game, world, z, game.marine_x[m], game.marine_y[m], BITE - NESTLE)
    elif game.zergling_cooldown[z] <= 0.0:
        cooldown = ready_again(game, world, game.zergling_cooldown[z], CLAWS.period)
        game.zergling_cooldown[z] = cooldown
        if world.damage_point > 0.0:
            game.zergling_swing[z] = world.damage_point
        else:
            bite(game, m)


@kernel
def fight(game: Game, world: World, loop: int) -> None:
    """Let all marines and zerglings act for a loop, of this number."""
    marines = 0  # beyond them no place is taken
    for m in range(MAX_MARINES):
        if game.marine_hp[m] > 0.0:
            marines = m + 1
    for k in range(MAX_MARINES):
        m = (k + loop) % MAX_MARINES
        if game.marine_hp[m] > 0.0:
            act_marine(game, world, m, loop)
    for k in range(MAX_ZERGLINGS):
        z = (k + loop) % MAX_ZERGLINGS
        if game.zergling_hp[z] > 0.0:
            act_zergling(game, world, z, loop, marines)
