"""The real engine, on PySC2's own test environment: what it sends, sees and counts."""

from dataclasses import replace

import numpy as np
import pytest
from small_pysc2 import (
    BARRACKS,
    DEPOT,
    ENEMY,
    MARINE,
    SCV,
    ZERGLING,
    features,
    frame,
    play,
    unit,
)

from repaint_cli.envs.starcraft.build_order import BuildOrder
from repaint_cli.envs.starcraft.pysc2 import encoding
from repaint_cli.envs.starcraft.pysc2.engine import RealEngine
from repaint_cli.envs.starcraft.rts.constants import (
    ATTACK_POINT,
    BUILD_BARRACKS,
    BUILD_DEPOT,
    SELECT_ARMY,
    SELECT_POINT,
    TERMS,
    TRAIN_MARINE,
    TRAIN_SCV,
)
from repaint_cli.envs.starcraft.rts.maps import MAPS
from repaint_cli.envs.starcraft.simulator import StarCraftSimulator

__all__ = ["play"]

BUILD, FIND = MAPS["build-marines"], MAPS["find-and-defeat-zerglings"]
ALL = (319, 321, 524, 560, 23)


def begin(spec=BUILD, n=1, **settings):
    engine = RealEngine(spec, n, **settings)
    engine.reset(np.arange(n))
    return engine


def act(engine, command, x=10, y=20):
    """Give one game a command; what was counted by name, and how it ended."""
    terms, terminated, truncated = engine.step(np.array([[command, x, y]], np.int16))
    assert (terms.dtype, terms.shape) == (np.float32, (1, len(TERMS)))
    counted = {name: int(n) for name, n in zip(TERMS, terms[0], strict=True) if n}
    return counted, bool(terminated[0]), bool(truncated[0])


@pytest.mark.parametrize(
    ("command", "call"),
    [
        (BUILD_DEPOT, (91, [[0], [10, 20]])),
        (BUILD_BARRACKS, (42, [[0], [10, 20]])),
        (TRAIN_SCV, (490, [[0]])),
        (TRAIN_MARINE, (477, [[0]])),
        (SELECT_POINT, (2, [[0], [10, 20]])),
        (ATTACK_POINT, (12, [[0], [10, 20]])),
        (SELECT_ARMY, (7, [[0]])),
    ],
)
def test_each_command_is_a_function_of_pysc2(play, command, call):
    games = play(frame(abilities=ALL, army_count=3))
    act(begin(FIND), command)
    (game,) = games.made
    assert game.calls[-1] == call
    if len(call[1]) == 2:
        layer = game.sent[-1].action_feature_layer
        point = layer.unit_selection_point.selection_screen_coord
        if command != SELECT_POINT:
            point = layer.unit_command.target_screen_coord
        assert (point.x, point.y) == (10, 20)


def test_what_is_not_available_is_no_op_and_counted(play):
    games = play(frame(abilities=(524,)))
    engine = begin()
    assert engine.observe().available.tolist() == [[0, 0, 1, 0, 1, 0, 0]]
    assert act(engine, BUILD_DEPOT) == ({"unavailable": 1}, False, False)
    assert games.made[0].calls == [(0, [])]


def test_an_army_takes_no_commands_where_there_is_nothing_to_attack(play):
    games = play(frame(abilities=ALL, army_count=3))
    engine = begin()
    assert engine.observe().available.tolist() == [[1, 1, 1, 1, 1, 0, 0]]
    for command in (ATTACK_POINT, SELECT_ARMY):
        assert act(engine, command)[0] == {"unavailable": 1}
    assert [call for call, _ in games.made[0].calls] == [0, 0]
    assert begin(FIND).observe().available.all()


def test_observations_are_as_our_simulators_are(play):
    play(frame(minerals=115, food_used=13, food_cap=23, food_workers=13, army_count=2))
    seen = begin(n=2).observe()
    assert [(a.shape, a.dtype) for a in seen] == [
        ((2, 9, 84, 84), np.uint8), ((2, 3, 84, 84), np.uint8), ((2, 5), np.int32),
        ((2, 7), np.uint8),
    ]  # fmt: skip
    assert seen.measurements.tolist() == [[115, 13, 23, 13, 2]] * 2


def test_given_arrays_are_filled_with_the_rows_that_are_asked_for(play):
    play(frame(minerals=115))
    engine = begin(n=3)
    seen = engine.observe(np.array([1, 2]))
    for array in seen:
        assert len(array) == 2
        array[:] = 9
    assert engine.observe(np.array([0, 2]), seen) is seen
    assert seen.measurements[:, 0].tolist() == [115, 115]


def test_layers_are_encoded_as_our_simulator_draws_them(play):
    row = np.zeros((84, 84), int)

    def layer(*values):
        made = row.copy()
        made[40, : len(values)] = values
        return made

    kinds = [18, DEPOT, 47, BARRACKS, SCV, MARINE, ZERGLING, 341, 483, 1, 1950, 9999]
    screen = {
        "visibility_map": layer(0, 1, 2, 3),
        "player_relative": layer(0, 1, 2, 3, 4),
        "unit_type": layer(*kinds),
        "selected": layer(0, 1),
        "unit_hit_points": layer(0, 45, 400, 1600, 9999),
        "unit_hit_points_ratio": layer(0, 128, 255),
        "unit_density": layer(1, 15, 16, 300),
        "unit_density_aa": layer(16, 255, 300),
    }
    small = {"visibility_map": layer(3), "player_relative": layer(4), "selected": layer(1)}
    play(frame(layers=screen, minimap=small))
    seen = begin().observe()
    pixels = seen.screen[0, :, 40]
    for i, expected in {
        1: [0, 1, 2, 0],
        2: [0, 1, 2, 3, 4],
        3: [1, 2, 2, 3, 4, 5, 6, 7, 7, 0, 0, 0],
        4: [0, 1],
        5: [round(255 * np.log1p(hp) / np.log1p(1600)) for hp in (0, 45, 400, 1600, 1600)],
        6: [0, 128, 255],
        7: [1, 15, 15, 15],
        8: [16, 255, 255],
    }.items():
        assert pixels[i, : len(expected)].tolist() == expected, i
    assert seen.minimap[0, :, 40, 0].tolist() == [0, 4, 1]


def test_the_layer_of_heights_shows_where_units_can_be(play):
    play(frame())
    heights = begin().observe().screen[0, 0]
    assert set(np.unique(heights)) == {0, 127}
    # the camera's middle is at y 25 and 24 units high; the base reaches from 18.998 to 36.998
    rows = np.flatnonzero(heights.any(1))
    assert (rows[0], rows[-1]) == (0, 62)
    assert heights[:63].all()


def test_what_happened_is_told_by_tags(play):
    start = [unit(1, SCV), unit(2, SCV)]
    barracks = unit(3, BARRACKS, progress=0.5)
    play(
        frame(0, start),
        frame(8, [*start, unit(4, SCV), barracks]),
        frame(16, [*start, unit(4, SCV), unit(3, BARRACKS), unit(9, DEPOT)]),
        frame(24, [*start, unit(4, SCV), unit(3, BARRACKS), unit(5, MARINE), unit(6, MARINE)]),
        frame(32, [*start, unit(4, SCV), unit(3, BARRACKS), unit(6, MARINE)]),
    )
    engine = begin()
    told = [act(engine, TRAIN_SCV)[0] for _ in range(5)]
    for one in told:
        assert one.pop("unavailable") == 1
    assert told == [
        {"scvs_trained": 1}, {"barracks_built": 1}, {"marines_built": 2}, {"marines_died": 1}, {},
    ]  # fmt: skip


def test_zerglings_that_die_are_counted_and_those_in_the_fog_are_not(play):
    marines = [unit(i, MARINE) for i in range(3)]
    zerglings = [unit(10 + i, ZERGLING, ENEMY) for i in range(3)]
    first = frame(0, [*marines, *zerglings], army_count=3)
    play(
        first, first,
        frame(16, [*marines, zerglings[0]], dead=[11], army_count=3),
        frame(24, marines[:2], dead=[0, 10], army_count=2),
    )  # fmt: skip
    engine = begin(FIND)
    assert act(engine, SELECT_POINT)[0] == {"zerglings_killed": 1, "select_miss": 1}
    assert act(engine, SELECT_POINT)[0]["zerglings_killed"] == 1
    assert act(engine, SELECT_POINT)[0] == {"select_miss": 1}


def test_a_click_hits_where_a_unit_of_ours_is_selected_by_it(play):
    relative = np.zeros((84, 84), int)
    relative[20, 10], relative[20, 11] = 1, 3
    layers = {"player_relative": relative}
    none, chosen = [unit(1, SCV), unit(2, SCV)], [unit(1, SCV, selected=True), unit(2, SCV)]
    play(
        frame(0, none, layers=layers), frame(8, none, layers=layers),
        frame(16, chosen, layers=layers), frame(24, chosen, layers=layers),
        frame(32, chosen, layers=layers), frame(40, none, layers=layers),
    )  # fmt: skip
    engine = begin()
    told = [act(engine, SELECT_POINT, x, 20)[0] for x in (50, 10, 10, 50, 11)]
    hits = ["select_hit" if one == {"select_hit": 1} else "select_miss" for one in told]
    assert hits == ["select_miss", "select_hit", "select_hit", "select_miss", "select_miss"]


def test_a_site_where_nothing_can_stand_counts_as_unavailable(play):
    begun = frame(0, abilities=ALL)
    play(begun, frame(8, abilities=ALL, errors=[44]), frame(16, abilities=ALL, errors=[1]))
    engine = begin()
    assert act(engine, BUILD_BARRACKS)[0] == {"unavailable": 1}
    assert act(engine, BUILD_DEPOT)[0] == {}


def test_the_game_is_started_as_the_paper_plays_it(play):
    games = play(frame())
    begin()
    settings = games.made[0].settings
    aif = settings["agent_interface_format"]
    assert settings["map_name"].path.endswith("Maps/mini_games/BuildMarines.SC2Map")
    assert settings["map_name"].data is not None
    assert [player.race[0].name for player in settings["players"]] == ["terran"]
    assert aif.feature_dimensions == features.Dimensions(screen=84, minimap=84)
    assert aif.camera_width_world_units == 24
    assert {name: settings[name] for name in ("step_mul", "game_steps_per_episode")} == {
        "step_mul": 8, "game_steps_per_episode": 13_440,
    }  # fmt: skip


def test_an_episode_ends_by_its_time_or_by_its_map(play):
    play(frame(0), frame(952), frame(960))
    engine = begin(replace(BUILD, minutes=1.0))
    assert act(engine, SELECT_POINT)[1:] == (False, False)
    assert engine.stats()["loop"].tolist() == [952]
    assert act(engine, SELECT_POINT)[1:] == (False, True)


def test_a_map_that_ends_before_its_time_terminates(play, monkeypatch):
    from pysc2.env.environment import StepType

    games = play(frame(0), frame(8), frame(16))
    engine = begin(FIND)
    last = games.step

    def end(self, actions, step_mul=None):
        (step,) = last(self, actions)
        return [step._replace(step_type=StepType.LAST)]

    monkeypatch.setattr(games, "step", end)
    assert act(engine, SELECT_POINT)[1:] == (True, False)


def test_marines_that_are_selected_at_the_beginning_are_seen_after_a_no_op(play):
    games = play(frame(0, army_count=3), frame(8, army_count=3))
    engine = begin(FIND)
    assert games.made[0].calls == [(0, [])]
    assert engine.stats()["loop"].tolist() == [8]


def test_games_that_do_not_play_stand_still(play):
    games = play(frame(0, abilities=ALL))
    engine = begin(n=2)
    actions = np.tile(np.array([TRAIN_SCV, 0, 0], np.int16), (2, 1))
    engine.step(actions, np.array([False, True]))
    assert [len(game.calls) for game in games.made] == [0, 1]
    engine.close()
    assert all(game.closed for game in games.made)


@pytest.mark.parametrize(
    "action", [(7, 0, 0), (-1, 0, 0), (SELECT_POINT, 84, 0), (SELECT_POINT, 0, -1)]
)
def test_actions_that_are_none_are_refused(play, action):
    play(frame())
    with pytest.raises(ValueError, match=r"expected commands below 7 and pixels below 84, found"):
        act(begin(), *action)


def test_unit_types_are_pysc2s_own():
    table = encoding.unit_types()
    assert table[[18, 19, 47, 21, 45, 48, 105, 341, 483]].tolist() == [1, 2, 2, 3, 4, 5, 6, 7, 7]
    assert table[-1] == 0


def test_the_build_order_plays_by_what_the_real_layers_show(play):
    types, relative = np.zeros((2, 84, 84), int)
    types[24:43, 20:40], relative[24:43, 20:40] = 18, 1
    types[30, 12] = SCV
    relative[30, 12] = 1
    layers = {"unit_type": types, "player_relative": relative}
    settings = {"layers": layers, "abilities": (319, 524)}
    later = [
        frame(8 * t, minerals=120, food_used=used, **settings) for t, used in ((1, 12), (2, 13))
    ]
    games = play(frame(0, **settings), *later)
    engine = begin()
    seen = engine.observe()
    order = BuildOrder(seen)
    for _ in range(4):
        engine.step(order.act(seen)[None])
        seen = engine.observe()
    assert games.made[0].calls == [
        (2, [[0], [30, 33]]), (490, [[0]]),  # an SCV, of the command centre
        (2, [[0], [12, 30]]), (91, [[0], [3, 59]]),  # a depot, by the SCV
    ]  # fmt: skip


@pytest.mark.parametrize("name", ["build-marines", "find-and-defeat-zerglings"])
def test_an_environment_plays_it(play, name):
    play(frame(0, abilities=ALL), frame(8, abilities=ALL), frame(16, army_count=2))
    env = StarCraftSimulator(simulator="starcraft", map=name, engine="pysc2").make(2, False, None)
    seen, _ = env.reset(seed=5)
    assert seen in env.observation_space
    env.action_space.seed(1)
    for _ in range(5):
        seen, rewards, terminated, truncated, infos = env.step(env.action_space.sample())
        assert seen in env.observation_space
    assert not (terminated | truncated).any()
    assert rewards.shape == (2,)
    assert set(TERMS) <= infos.keys()
    env.close()
