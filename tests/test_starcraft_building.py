"""Where structures may stand, when they are paid, and which command is available when."""

from dataclasses import replace

import numpy as np
import pytest
from starcraft_bots import pixel

from repaint_cli.envs.starcraft.rts.constants import (
    ATTACK_POINT,
    BUILD_BARRACKS,
    BUILD_DEPOT,
    SELECT_ARMY,
    SELECT_POINT,
    TRAIN_MARINE,
    TRAIN_SCV,
)
from repaint_cli.envs.starcraft.rts.engine import MiniRTS
from repaint_cli.envs.starcraft.rts.maps import BUILD_MARINES, BUILD_MARINES_FDZ
from repaint_cli.envs.starcraft.rts.state import CONSTRUCTING, IDLE, TO_PATCH, TO_SITE


def begun(spec=BUILD_MARINES, minerals=1000, **settings):
    rts = MiniRTS(replace(spec, **settings), 1)
    rts.reset(np.zeros(1, int))
    rts.state.minerals[0] = minerals
    return rts


def act(rts, command, x=0.0, y=0.0):
    """Say a command about a place; return the terms of the step."""
    phi, _, _ = rts.step(np.array([(command, *pixel(rts, x, y))]))
    return phi[0]


def select_scv(rts, i=0):
    s = rts.state
    assert act(rts, SELECT_POINT, s.scv_x[0, i], s.scv_y[0, i])[3] == 1
    return s.selected_index[0]


def wait(rts, steps):
    return sum(act(rts, ATTACK_POINT) for _ in range(steps))


def with_structure(rts, kind, x, y, finished=True):
    """Put a structure onto the map."""
    s = rts.state
    slot = np.flatnonzero(s.arrays[f"{kind}_done"][0] == 0)[0]
    s.arrays[f"{kind}_x"][0, slot], s.arrays[f"{kind}_y"][0, slot] = x, y
    s.arrays[f"{kind}_begun"][0, slot] = 0
    s.arrays[f"{kind}_done"][0, slot] = 1 if finished else 10_000
    return slot


def test_a_depot_is_paid_on_arrival_and_done_480_loops_later():
    rts = begun()
    i = select_scv(rts)
    terms = act(rts, BUILD_DEPOT, 36, 22)
    assert not terms.any()
    s = rts.state
    assert s.scv_state[0, i] == TO_SITE
    before = s.minerals[0]
    while s.scv_state[0, i] == TO_SITE:
        assert s.minerals[0] >= before
        before = s.minerals[0]
        wait(rts, 1)
    assert s.scv_state[0, i] == CONSTRUCTING
    assert before - s.minerals[0] in (95, 100)
    assert (s.depot_x[0, 0], s.depot_y[0, 0]) == (36, 22)
    assert s.depot_done[0, 0] - s.depot_begun[0, 0] == 480
    while s.scv_state[0, i] == CONSTRUCTING:
        assert s.food_cap[0] == 15
        assert act(rts, BUILD_DEPOT, 40, 22)[0] == 1  # it builds already
    assert 0 <= s.loop[0] - s.depot_done[0, 0] < 8
    assert s.food_cap[0] == 23
    assert s.scv_state[0, i] == IDLE
    assert rts.stats()["depots_built"][0] == 1


def test_barracks_take_1040_loops_count_when_done_and_the_scv_mines_if_asked():
    rts = begun(scv_after_build="mine")
    with_structure(rts, "depot", 40, 34)
    i = select_scv(rts)
    act(rts, BUILD_BARRACKS, 36.4, 22.6)
    s = rts.state
    while s.scv_state[0, i] == TO_SITE:
        wait(rts, 1)
    assert (s.barracks_x[0, 0], s.barracks_y[0, 0]) == (36.5, 22.5)
    assert s.barracks_done[0, 0] - s.barracks_begun[0, 0] == 1040
    assert wait(rts, 131)[5] == 1
    assert s.scv_state[0, i] == TO_PATCH


def test_awards_on_order_come_with_the_order():
    rts = begun(award_on="order")
    act(rts, SELECT_POINT, 29.5, 27.5)
    assert act(rts, TRAIN_SCV)[4] == 1
    with_structure(rts, "depot", 40, 34)
    with_structure(rts, "barracks", 40.5, 30.5)
    select_scv(rts)
    act(rts, BUILD_BARRACKS, 36.5, 22.5)
    assert wait(rts, 20)[5] == 1
    act(rts, SELECT_POINT, 40.5, 30.5)
    assert act(rts, TRAIN_MARINE)[6] == 1
    assert not wait(rts, 140)[4:7].any()


def test_who_arrives_short_of_minerals_builds_nothing():
    rts = begun()
    i = select_scv(rts)
    act(rts, BUILD_DEPOT, 40, 22)
    s = rts.state
    while s.scv_state[0, i] == TO_SITE:
        s.minerals[0] = 90
        wait(rts, 1)
    assert s.scv_state[0, i] == IDLE
    assert not s.depot_done.any()


@pytest.mark.parametrize(
    ("command", "x", "y"),
    [
        (BUILD_DEPOT, 29.5, 27.5),  # on the centre
        (BUILD_DEPOT, 24.0, 28.5),  # on minerals
        (BUILD_DEPOT, 40.0, 18.4),  # outside the base
        (BUILD_DEPOT, 37.0, 23.0),  # over a depot's corner
        (BUILD_BARRACKS, 37.4, 22.4),
        (BUILD_BARRACKS, 30.0, 19.5),  # only partly in the base
    ],
)  # fmt: skip
def test_an_illegal_site_is_refused(command, x, y):
    rts = begun()
    with_structure(rts, "depot", 36, 22)
    i = select_scv(rts)
    state = rts.state.scv_state[0, i]
    assert act(rts, command, x, y)[0] == 1
    assert rts.state.last_refused[0]
    assert rts.state.scv_state[0, i] in (state, state + 1)
    assert not (rts.state.scv_state[0] == TO_SITE).any()
    rts = begun(illegal_site_is_unavailable=False)
    with_structure(rts, "depot", 36, 22)
    select_scv(rts)
    assert not act(rts, command, x, y).any()


def test_structures_may_touch():
    rts = begun()
    with_structure(rts, "depot", 36, 22)
    select_scv(rts)
    assert not act(rts, BUILD_DEPOT, 38, 22).any()


def test_a_site_in_the_fog_is_refused():
    rts = begun(BUILD_MARINES_FDZ)
    select_scv(rts)
    assert rts.state.visibility[0, 30, 44] == 0
    assert act(rts, BUILD_DEPOT, 44, 30)[0] == 1
    assert not act(rts, BUILD_DEPOT, 36, 30).any()


def ready(rts, kind):
    """Have something selected, without a step."""
    s = rts.state
    s.selected_kind[0] = {"nothing": 0, "scv": 1, "centre": 2, "barracks": 3, "depot": 4}.get(
        kind, 5
    )
    s.selected_index[0] = 0
    if kind == "marines":
        s.marine_hp[0, 0], s.marine_selected[0, 0], s.army_count[0] = 45, 1, 1


RICH = {"minerals": 1000, "food_used": 12, "food_cap": 23, "centre_queue": 0}
RULES = [
    # selected, what differs, depot, barracks, queue, available
    ("nothing", {}, True, True, 0, ()),
    ("scv", {}, True, True, 0, (BUILD_DEPOT, BUILD_BARRACKS)),
    ("scv", {}, False, True, 0, (BUILD_DEPOT,)),
    ("scv", {"minerals": 149}, True, True, 0, (BUILD_DEPOT,)),
    ("scv", {"minerals": 99}, True, True, 0, ()),
    ("scv constructing", {}, True, True, 0, ()),
    ("centre", {}, True, True, 0, (TRAIN_SCV,)),
    ("centre", {"minerals": 49}, True, True, 0, ()),
    ("centre", {"food_used": 23}, True, True, 0, ()),
    ("centre", {"centre_queue": 5}, True, True, 0, ()),
    ("centre", {"food_workers": 64}, True, True, 0, ()),
    ("barracks", {}, True, True, 0, (TRAIN_MARINE,)),
    ("barracks", {}, True, False, 0, ()),
    ("barracks", {}, True, True, 5, ()),
    ("barracks", {"minerals": 49}, True, True, 0, ()),
    ("barracks", {"food_used": 23}, True, True, 0, ()),
    ("depot", {}, True, True, 0, ()),
    ("marines", {}, True, True, 0, (ATTACK_POINT, SELECT_ARMY)),
]


@pytest.mark.parametrize("spec", [BUILD_MARINES, BUILD_MARINES_FDZ], ids=lambda spec: spec.name)
@pytest.mark.parametrize("rule", RULES)
def test_a_command_is_available_when_the_rules_say_so(spec, rule):
    selected, differs, depot, barracks, queue, available = rule
    rts = begun(spec)
    s = rts.state
    if depot:
        with_structure(rts, "depot", 36, 22)
    with_structure(rts, "barracks", 40.5, 30.5, finished=barracks)
    s.barracks_queue[0, 0], s.barracks_head[0, 0] = queue, 5000
    for name, value in (RICH | differs).items():
        s.arrays[name][0] = value
    s.centre_head[0] = 5000
    ready(rts, selected.split()[0])
    if "constructing" in selected:
        s.scv_state[0, 0], s.scv_t1[0, 0] = CONSTRUCTING, 5000
    s.patch_free[0] = 1e9  # nobody earns anything in this step
    s.available[0] = 0
    act(rts, SELECT_ARMY)  # which is refused
    wanted = {SELECT_POINT, *available}
    if spec is BUILD_MARINES:
        wanted -= {ATTACK_POINT, SELECT_ARMY}
    assert set(np.flatnonzero(s.available[0])) == wanted


def test_an_unavailable_command_changes_nothing_but_the_clock_and_its_term():
    rts, other = begun(), begun()
    for command in (
        BUILD_DEPOT,
        BUILD_BARRACKS,
        TRAIN_SCV,
        TRAIN_MARINE,
        ATTACK_POINT,
        SELECT_ARMY,
    ):
        assert act(rts, command).tolist() == [1, 0, 0, 0, 0, 0, 0, 0]
        act(other, SELECT_POINT, 40, 34)  # ground: a miss, which changes no selection either
        for name in rts.state.arrays.dtype.names:
            if name != "phi" and not name.startswith("last_"):
                mine, theirs = rts.state.arrays[name], other.state.arrays[name]
                np.testing.assert_array_equal(mine, theirs, name)


def test_select_point_takes_units_before_structures_and_keeps_what_it_misses():
    rts = begun()
    s = rts.state
    assert act(rts, SELECT_POINT, 29.5, 27.5)[3] == 1
    assert s.selected_kind[0] == 2
    for x, y in ((40, 34), (23.0, 28.5)):  # ground, minerals
        terms = act(rts, SELECT_POINT, x, y)
        assert (terms[2], terms[3], terms[0]) == (1, 0, 0)
        assert s.selected_kind[0] == 2
    s.marine_x[0, 3], s.marine_y[0, 3], s.marine_hp[0, 3] = 29.5, 29.0, 45  # on the centre
    assert act(rts, SELECT_POINT, 29.5, 29.0)[3] == 1
    assert s.selected_kind[0] == 5
    assert np.flatnonzero(s.marine_selected[0]).tolist() == [3]


def test_marines_appear_below_their_barracks_each_in_a_place_of_its_own():
    rts = begun(minerals=5000)
    with_structure(rts, "barracks", 38.5, 28.5)
    s = rts.state
    s.food_cap[0] = 100
    act(rts, SELECT_POINT, 38.5, 28.5)
    assert not any(act(rts, TRAIN_MARINE)[0] for _ in range(5))
    assert wait(rts, 260)[6] == 5
    assert s.army_count[0] == 5
    ways = np.hypot(*(a[0, :5, None] - a[0, None, :5] for a in (s.marine_x, s.marine_y)))
    assert (ways + np.eye(5)).min() > 0.75
    assert (np.hypot(s.marine_x[0, :5] - 38.5, s.marine_y[0, :5] - 26.6) < 2).all()


def test_a_standing_marine_is_pushed_out_of_what_is_built_over_it():
    rts = begun()
    s = rts.state
    s.marine_x[0, 0], s.marine_y[0, 0], s.marine_hp[0, 0], s.army_count[0] = 38.0, 28.0, 45, 1
    with_structure(rts, "barracks", 38.5, 28.5, finished=False)
    wait(rts, 16)
    assert abs(s.marine_x[0, 0] - 38.5) >= 1.875 or abs(s.marine_y[0, 0] - 28.5) >= 1.875


def test_supply_stops_at_200_and_arrays_never_overflow():
    rts = begun()
    rts.state.food_cap[0] = 196
    i = select_scv(rts)
    act(rts, BUILD_DEPOT, 36, 22)
    wait(rts, 90)
    assert rts.state.food_cap[0] == 200
    assert rts.state.scv_state[0, i] == IDLE
    rts.state.depot_done[0] = 1
    rts.state.depot_x[0, 1:] = 100
    rts.state.minerals[0] = 1000
    select_scv(rts, 1)
    assert not rts.state.available[0, BUILD_DEPOT]
