"""The fog is lifted where units see, and nowhere else."""

import numpy as np
from starcraft_reference_fights import FightingGame
from test_starcraft_combat import random_actions, with_marines

from repaint_cli.envs.starcraft.rts.constants import ENEMY, HIDDEN, SEEN, VISIBLE
from repaint_cli.envs.starcraft.rts.engine import MiniRTS
from repaint_cli.envs.starcraft.rts.fog import HALF_WIDTHS
from repaint_cli.envs.starcraft.rts.maps import BUILD_MARINES, FIND_AND_DEFEAT_ZERGLINGS


def test_half_widths_are_those_of_discs():
    for sight, row in ((4, 0), (8, 8), (9, 5), (11, 11)):
        assert HALF_WIDTHS[sight, row] == int(np.sqrt(sight**2 - row**2))
    assert HALF_WIDTHS[4, 5] == -1


def test_what_is_visible_equals_the_union_of_all_discs():
    rts, rng = with_marines(4, 30), np.random.default_rng(2)
    rts.state.minerals[:] = 1000
    for _ in range(12):
        for _ in range(10):
            rts.step(random_actions(rng, 4))
        for row in range(4):
            game = rts.state.arrays[row]
            reference = FightingGame(game, rts.world[0])
            reference.visibility = np.minimum(game["visibility"], SEEN).tolist()
            reference.lift_fog()
            np.testing.assert_array_equal(game["visibility"], reference.visibility)


def test_what_was_seen_stays_seen_and_no_enemy_shows_in_the_fog():
    rts, rng = with_marines(8, 4), np.random.default_rng(3)
    before = rts.state.visibility.copy()
    shown = 0
    for _ in range(80):
        rts.step(random_actions(rng, 8))
        now = rts.state.visibility
        assert not ((before != HIDDEN) & (now == HIDDEN)).any()
        before = now.copy()
        seen = rts.observe()
        for layers, player in ((seen.screen, 2), (seen.minimap, 1)):
            enemies = layers[:, player] == ENEMY
            shown += np.count_nonzero(enemies)
            assert (layers[:, player - 1][enemies] == VISIBLE).all()
        for row in range(8):
            game = rts.state.arrays[row]
            cells = game["zergling_y"].astype(int), game["zergling_x"].astype(int)
            visible = (game["zergling_hp"] > 0) & (game["visibility"][cells] == VISIBLE)
            if not visible.any():
                assert not (seen.screen[row, 2] == ENEMY).any()
                assert not (seen.minimap[row, 1] == ENEMY).any()
    assert shown > 0


def test_without_fog_the_whole_region_is_visible_and_nothing_else():
    rts = MiniRTS(BUILD_MARINES, 1)
    rts.reset(np.zeros(1, int))
    visible = np.argwhere(rts.state.visibility[0] == VISIBLE)
    assert visible.min(axis=0).tolist() == [19, 20]
    assert visible.max(axis=0).tolist() == [36, 45]
    assert len(visible) == 18 * 26
    assert not (rts.state.visibility == SEEN).any()


def test_at_the_start_three_marines_see_nine_units_far():
    rts = MiniRTS(FIND_AND_DEFEAT_ZERGLINGS, 1)
    rts.reset(np.zeros(1, int))
    visible = np.argwhere(rts.state.visibility[0] == VISIBLE) + 0.5
    far = np.hypot(*(visible - (28, 32)).T)
    assert 10 < far.max() < 11.5
    assert len(visible) > np.pi * 9**2
