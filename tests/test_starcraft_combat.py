"""Marines and zerglings fight as the game's numbers say; zerglings stay out of the base."""

from dataclasses import replace

import numpy as np
import pytest
from starcraft_bots import SWEEP_PATH, WAIT, Sweep, play
from starcraft_reference_fights import FightingGame

from repaint_cli.envs.starcraft.rts.constants import ATTACK_POINT, SELECT_ARMY
from repaint_cli.envs.starcraft.rts.engine import MiniRTS
from repaint_cli.envs.starcraft.rts.maps import (
    BASE,
    BUILD_MARINES_FDZ,
    FIND_AND_DEFEAT_ZERGLINGS,
)
from repaint_cli.envs.starcraft.rts.step import fight_rows
from repaint_cli.envs.starcraft.rts.zerglings import BASE_MARGIN


def inside_base(x, y, margin=0.0):
    across = (x > BASE.left - margin) & (x < BASE.right + margin)
    return across & (y > BASE.bottom - margin) & (y < BASE.top + margin)


def duel(**world):
    """A marine and a zergling, 5.75 apart: the loop of the last shot, shots, and hit points."""
    rts = MiniRTS(replace(FIND_AND_DEFEAT_ZERGLINGS, marines=1, respawn=False), 1)
    rts.reset(np.zeros(1, int))
    for name, value in {"delay_low": 0, "delay_high": 0, "damage_point": 0, **world}.items():
        rts.world[name] = value
    s = rts.state
    s.zergling_hp[0, 1:] = 0
    s.marine_x[0, 0], s.marine_y[0, 0] = 30, 28
    s.zergling_x[0, 0] = s.zergling_home_x[0, 0] = 35.75
    s.zergling_y[0, 0] = s.zergling_home_y[0, 0] = 28
    rts.world["loops"] = 1  # a fight of a loop at a time
    shots = 0
    for loop in range(200):
        s.loop[0], rts.world["loops"] = loop, loop + 1
        before = s.zergling_hp[0, 0]
        fight_rows(np.zeros(1, np.int64), s.arrays, rts.world)
        shots += s.zergling_hp[0, 0] < before
        if s.zergling_hp[0, 0] == 0:
            return loop, shots, s.marine_hp[0, 0]
    return None


def test_a_marine_wins_a_duel_in_82_loops():
    assert duel() == (82, 7, 20.0)


def test_a_marine_wins_a_duel_sooner_if_zerglings_do_not_heal():
    assert duel(regeneration=0) == (68, 6, 25.0)


def test_a_group_that_sweeps_kills_as_many_zerglings_as_people_do():
    rts = MiniRTS(FIND_AND_DEFEAT_ZERGLINGS, 50)
    rts.reset(np.arange(50))
    stats = play(rts, [Sweep(rts, row, SWEEP_PATH) for row in range(50)])
    score = stats["zerglings_killed"] - stats["marines_died"]
    assert 45 <= score.mean() <= 62
    assert stats["army_count"].mean() > 2.9
    assert (stats["loop"] == 2880).all()


def random_actions(rng, n):
    return np.stack([rng.integers(0, high, n) for high in (7, 84, 84)], axis=1)


def with_marines(n, each, spec=BUILD_MARINES_FDZ):
    """Games with marines all over the map."""
    rts = MiniRTS(spec, n)
    rts.reset(np.arange(n))
    rng = np.random.default_rng(0)
    s = rts.state
    s.marine_x[:, :each] = rng.uniform(3, 61, (n, each))
    s.marine_y[:, :each] = rng.uniform(3, 61, (n, each))
    s.marine_hp[:, :each], s.army_count[:], s.food_used[:] = 45, each, 12 + each
    return rts


def test_no_zergling_is_ever_in_the_base():
    """For 128 games of 8,000 loops, 10⁶ in all, with marines that run about, in the base too."""
    rts, rng = with_marines(128, 8), np.random.default_rng(1)
    chased = 0
    for k in range(1000):
        actions = random_actions(rng, 128)
        actions[:, 0] = SELECT_ARMY if k % 2 == 0 else ATTACK_POINT
        rts.step(actions)
        s = rts.state
        alive = s.zergling_hp > 0
        assert not (alive & inside_base(s.zergling_x, s.zergling_y)).any()
        chased += np.count_nonzero(alive & inside_base(s.zergling_x, s.zergling_y, 0.01))
        if k % 50 == 0:  # marines stand at the base's right border, and run off
            s.marine_x[:, :8] = rng.uniform(44, 46, (128, 8))
            s.marine_y[:, :8] = rng.uniform(19, 37, (128, 8))
            s.marine_hp[:, :8], s.army_count[:] = 45, 8
    assert chased > 100  # some stood at the border
    assert rts.stats()["zerglings_killed"].sum() > 1000


def test_a_zergling_gives_up_who_is_out_of_its_reach_in_the_base_and_goes_home():
    rts = with_marines(1, 1)
    s = rts.state
    s.zergling_hp[0, 1:] = 0
    s.zergling_x[0, 0] = s.zergling_home_x[0, 0] = 50
    s.zergling_y[0, 0] = s.zergling_home_y[0, 0] = 28
    s.marine_x[0, 0], s.marine_y[0, 0] = 45.2, 28
    for _ in range(10):
        rts.step(np.array([WAIT]))
    assert BASE.right <= s.zergling_x[0, 0] <= BASE.right + 0.12  # it bites over the border
    assert s.marine_hp[0, 0] < 45
    s.marine_x[0, 0], s.marine_hp[0, 0], s.zergling_hp[0, 0] = 40, 45, 35
    for _ in range(20):
        rts.step(np.array([WAIT]))
    assert s.zergling_x[0, 0] == pytest.approx(50, abs=0.2)
    assert s.marine_hp[0, 0] == 45


def test_a_blow_at_a_marine_that_died_does_not_hit_the_one_that_is_born_in_its_place():
    rts = with_marines(1, 0)
    s = rts.state
    s.barracks_x[0, 0], s.barracks_y[0, 0], s.barracks_done[0, 0] = 40, 30, 1
    s.barracks_queue[0, 0], s.barracks_head[0, 0] = 1, 4
    s.zergling_hp[0, 1:] = 0
    s.zergling_target[0, 0], s.zergling_swing[0, 0] = 0, 10  # far away, at who was the first
    game = FightingGame(s.arrays[0], rts.world[0])
    for _ in range(3):
        rts.step(np.array([WAIT]))
        game.step(*WAIT)
    assert s.marines_built[0] == 1
    assert s.marine_hp[0, 0] == game.marine_hp[0] == 45
    assert s.zergling_target[0, 0] == game.zergling_target[0] == -1


def apart(xs, ys):
    ways = np.hypot(xs[:, :, None] - xs[:, None], ys[:, :, None] - ys[:, None])
    return (ways + 100 * np.eye(xs.shape[1])).min()


def test_forty_zerglings_appear_hidden_apart_and_outside_the_base():
    rts = MiniRTS(BUILD_MARINES_FDZ, 200)
    rts.reset(np.arange(200))
    s = rts.state
    assert (s.zergling_hp == 35).all()
    cells = s.zergling_y.astype(int), s.zergling_x.astype(int)
    assert not s.visibility[np.arange(200)[:, None], *cells].any()
    assert not inside_base(s.zergling_x, s.zergling_y, BASE_MARGIN).any()
    closer = s.placed_closer > 0
    for game in range(200):
        ways = apart(s.zergling_x[game : game + 1], s.zergling_y[game : game + 1])
        assert 3.0 <= ways < 5.0 if closer[game] else ways >= 5.0
    assert closer.mean() < 0.5


def test_zerglings_are_spread_over_the_map():
    """Beside the base, as many as the area has room for: chi-square over eight sectors, 7 free."""
    rts = MiniRTS(BUILD_MARINES_FDZ, 100)
    rts.reset(np.arange(100))
    xs, ys = rts.state.zergling_x.ravel(), rts.state.zergling_y.ravel()
    rng = np.random.default_rng(0)
    px, py = rng.uniform(3, 61, (2, 400_000))
    free = ~inside_base(px, py, BASE_MARGIN)
    free &= np.array(rts.state.visibility[0])[py.astype(int), px.astype(int)] == 0

    def sectors(x, y):
        return np.bincount(((np.arctan2(y - 32, x - 32) / np.pi + 1) * 4).astype(int) % 8)

    wanted = sectors(px[free], py[free]) / np.count_nonzero(free) * len(xs)
    assert ((sectors(xs, ys) - wanted) ** 2 / wanted).sum() < 40


def test_zerglings_appear_again_away_from_marines():
    rts = MiniRTS(FIND_AND_DEFEAT_ZERGLINGS, 20)
    rts.reset(np.arange(20))
    s = rts.state
    middle = np.hypot(s.zergling_x - 32, s.zergling_y - 28)
    assert ((middle[:, 0] >= 8) & (middle[:, 0] <= 9)).all()
    assert ((middle[:, 1] >= 7.5) & (middle[:, 1] <= 9.5)).all()
    assert (middle[:, 2:25] >= 10.5).all()
    s.zergling_hp[:] = 0
    rts.step(np.tile(WAIT, (20, 1)))
    assert (s.respawns == 1).all()
    assert ((s.zergling_hp > 0).sum(axis=1) == 25).all()
    ways = np.hypot(
        s.zergling_x[:, :25, None] - s.marine_x[:, None, :3],
        s.zergling_y[:, :25, None] - s.marine_y[:, None, :3],
    )
    assert ways.min() >= 9


def test_without_respawn_the_dead_stay_dead():
    rts = MiniRTS(replace(FIND_AND_DEFEAT_ZERGLINGS, respawn=False), 1)
    rts.reset(np.zeros(1, int))
    rts.state.zergling_hp[:] = 0
    rts.step(np.array([WAIT]))
    assert not rts.state.zergling_hp.any()


def test_a_game_without_marines_is_over():
    rts = MiniRTS(FIND_AND_DEFEAT_ZERGLINGS, 2)
    rts.reset(np.arange(2))
    rts.state.marine_hp[0], rts.state.army_count[0] = 0, 0
    _, terminated, truncated = rts.step(np.tile(WAIT, (2, 1)))
    assert terminated.tolist() == [True, False]
    assert not truncated.any()


def test_a_crowd_is_pushed_apart():
    rts = with_marines(1, 40)
    s = rts.state
    s.marine_x[0, :40], s.marine_y[0, :40] = np.random.default_rng(0).uniform(38, 39, (2, 40))
    for _ in range(120):
        rts.step(np.array([WAIT]))
    assert apart(s.marine_x[:, :40], s.marine_y[:, :40]) > 0.7
