"""Minerals, training and building take the time and give the sums that the game has."""

from dataclasses import replace

import numpy as np
import pytest
from starcraft_bots import WAIT, BuildingBot, pixel, play

from repaint_cli.envs.starcraft.rts.constants import SELECT_POINT, TRAIN_SCV
from repaint_cli.envs.starcraft.rts.engine import MiniRTS
from repaint_cli.envs.starcraft.rts.maps import BUILD_MARINES
from repaint_cli.envs.starcraft.rts.state import MINING, WAITING

LEFT, RIGHT = 0, 3
"""Seeds with which the first SCVs stand on the side of the patches, and on the other one."""


def begun(n=1, seeds=None, **settings):
    rts = MiniRTS(replace(BUILD_MARINES, **settings), n)
    rts.reset(np.arange(n) if seeds is None else np.array(seeds))
    return rts


def wait(rts, steps=1):
    for _ in range(steps):
        rts.step(np.tile(WAIT, (rts.n, 1)))


def bank(rts, loops):
    """Minerals of all games at some loops, (loops, N), when nobody spends any."""
    rows = []
    for loop in loops:
        wait(rts, loop // 8 - rts.state.loop[0] // 8)
        rows.append(rts.state.minerals.copy())
    return np.array(rows)


def test_the_side_of_the_first_scvs_is_chance():
    rts = begun(200)
    sides = np.sign(rts.state.scv_x[:, 0] - rts.world["centre_x"])
    assert sides[LEFT] == -1
    assert sides[RIGHT] == 1
    assert 70 < np.count_nonzero(sides == 1) < 130


def test_twelve_scvs_earn_what_they_earn_in_the_game():
    earned = bank(begun(2, (LEFT, RIGHT)), (224, 448, 896, 1344, 2688, 4480)).mean(axis=1)
    np.testing.assert_allclose(earned, [120, 240, 490, 720, 1430, 2390], rtol=0.03)


@pytest.mark.parametrize(("scvs", "income"), [(16, 924.9), (24, 1132.9)])
def test_a_minute_earns_what_was_measured_in_the_game(scvs, income):
    first, second = bank(begun(start_scvs=scvs), (1344, 4 * 1344))[:, 0]
    assert (second - first) / 3 == pytest.approx(income, rel=0.03)


def test_one_scv_earns_five_minerals_a_trip():
    (earned,) = bank(begun(2, (LEFT, RIGHT), start_scvs=1), (1344,))
    assert set(earned) <= {105, 110, 115}


def test_a_patch_has_one_scv_digging_and_minerals_are_conserved():
    rts = begun(start_scvs=24)
    s = rts.state
    for _ in range(400):
        wait(rts)
        digging = s.scv_patch[0, s.scv_state[0] == MINING]
        assert len(digging) == len(set(digging))
        total = s.minerals[0] - 50 + s.minerals_spent[0] + s.scv_carry[0].sum()
        assert total + s.patch_left[0].sum() == 8 * 1500
    assert (s.scv_state[0] == WAITING).any()


def test_patches_that_are_empty_are_left_and_at_last_all_scvs_stand():
    rts = begun(minerals=12)
    wait(rts, 120)
    assert rts.state.minerals_mined[0] == 8 * 12
    assert not rts.state.patch_left.any()
    assert not rts.state.patch_assigned.any()
    assert (rts.state.scv_state[0, :12] == 1).all()


def test_a_queue_of_five_scvs_is_done_every_272_loops():
    rts = begun()
    rts.state.minerals[0] = 10_000
    rts.state.food_cap[0] = 200
    centre = (SELECT_POINT, *pixel(rts, 29.5, 27.5))
    rts.step(np.array([centre]))
    rts.step(np.array([(TRAIN_SCV, 0, 0)]))  # at loop 8
    for _ in range(5):
        rts.step(np.array([(TRAIN_SCV, 0, 0)]))
    assert rts.state.centre_queue[0] == 5
    assert rts.state.last_refused[0]
    trained = []
    while len(trained) < 5:
        phi, _, _ = rts.step(np.array([WAIT]))
        trained += [rts.state.loop[0]] * int(phi[0, 4])
    assert trained == [8 + 272 * k for k in range(1, 6)]
    assert rts.state.food_workers[0] == 17 == rts.state.food_used[0]


def scripted(scvs, barracks, seeds):
    rts = begun(len(seeds), seeds, scv_after_build="mine")
    return rts, play(rts, [BuildingBot(rts, row, scvs, barracks) for row in range(len(seeds))])


def test_twenty_scvs_and_seven_barracks_build_what_they_build_in_the_game():
    rts, stats = scripted(20, 7, (LEFT, RIGHT))
    assert abs(rts.state.depot_done[0, 0] - 768) <= 16
    assert abs(rts.state.barracks_done[0, 0] - 1848) <= 16
    assert np.abs(stats["marines_built"] - 129).max() <= 5
    assert (stats["food_workers"] == 20).all()
    assert (stats["barracks_built"] == 7).all()


def test_twenty_four_scvs_and_eight_barracks_build_what_people_build():
    _, stats = scripted(24, 8, (LEFT, RIGHT))
    assert np.abs(stats["marines_built"] - 138).max() <= 4
