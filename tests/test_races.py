"""Race types: boxes, bots' settings, directions, random looks, and races of several laps."""

import json
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rich.console import Console

from repaint_cli.cli.episode_table import table
from repaint_cli.envs.episodes import Episodes
from repaint_cli.envs.racer.dynamics.car import commands_of
from repaint_cli.envs.racer.dynamics.objects import ObjectSettings, places
from repaint_cli.envs.racer.dynamics.race import RaceRules
from repaint_cli.envs.racer.env import RacerVectorEnv
from repaint_cli.envs.racer.names import STATUS
from repaint_cli.envs.racer.sight.appearance import KNOTS, RandomAppearance
from repaint_cli.envs.racer.simulator import RacerSimulator
from repaint_cli.envs.racer.sweep import sweep
from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.envs.racer.track.track import Track
from repaint_cli.envs.racer.wander import nearest, steering_to
from repaint_cli.errors import CardError
from repaint_cli.runs.progress import RunProgress, scores
from repaint_cli.zoo.tasks import read_task

BOXES = ObjectSettings(3, boxes=True, random=False)
OFF_TRACK, LAP_COMPLETE, CRASHED = map(STATUS.index, ("off_track", "lap_complete", "crashed"))


TRACKS = Path(__file__).parents[1] / "tasks" / "racer" / "tracks"


def racer(**settings):
    return RacerSimulator(simulator="racer", **settings)


def along_the_road(env, aims=0.0):
    """Actions that keep the cars beside the middle by `aims`, in widths of the road, (N,)."""
    fleet, n = env._fleet, env.num_envs
    angles = steering_to(fleet, np.full(n, aims))
    return nearest(commands_of(racer().actions), angles, np.full(n, 1.0))


@pytest.mark.parametrize("seed", range(20))
def test_objects_stand_where_they_are_told(seed):
    rng = np.random.default_rng(seed)
    where, sides = places(replace(BOXES, places=((0.25, 1), (0.5, -1), (1.5, 1))), 20.0, rng)
    assert_allclose(where, [5, 10, 10])
    assert_array_equal(sides, [1, -1, 1])
    where, sides = places(replace(BOXES, n=4, gap=3.0), 20.0, rng)
    assert_allclose(where, np.linspace(3, 19, 4))
    assert_array_equal(sides, [1, -1, 1, -1])
    where, sides = places(replace(BOXES, n=3, gap=4.0, random=True), 20.0, rng)
    assert np.diff(where).min() >= 4
    assert where[0] >= 4
    assert set(sides) <= {-1.0, 1.0}


def test_a_box_stands_still_and_is_told_to_reward_functions():
    env = RacerVectorEnv(load_track("wide-loop"), 1, objects=BOXES)
    _, first = env.reset(seed=1, options={"lap_fraction": [0.4]})
    for _ in range(5):
        *_, info = env.step(along_the_road(env))
    assert_array_equal(info["objects"], first["objects"])
    params = env.params(0)
    assert params["objects_speed"] == params["objects_heading"] == [0.0, 0.0, 0.0]
    assert_allclose(params["objects_location"], info["objects"][0, :, :2])
    assert_allclose(params["objects_distance"], np.linspace(2, params["track_length"] - 1, 3))
    assert params["objects_left_of_center"] == [True, False, True]  # counter-clockwise, inner first


@pytest.mark.parametrize("ahead", [True, False])
def test_a_crash_with_a_box_always_ends_an_episode(ahead):
    """Even one that is not ahead, where a crash with a bot would not count."""
    ended = {}
    for name, objects in {"box": replace(BOXES, n=1), "bot": ObjectSettings(1, speed=0.0)}.items():
        env = RacerVectorEnv(load_track("wide-loop"), 1, objects=objects)
        env.reset(seed=1, options={"lap_fraction": [0.5]})
        fleet = env._fleet
        fleet.objects.poses[0, 0, :3] = fleet.states[0, :3]
        fleet.objects.along[0, 0] = 0.5 * fleet.tracks[0].length + (0.3 if ahead else -0.5)
        _, _, terminated, _, info = env.step(along_the_road(env))
        ended[name] = bool(terminated[0]), int(info["status"][0])
        assert info["hit"][0] == 1
    assert ended == {"box": (True, CRASHED), "bot": (ahead, CRASHED if ahead else 0)}


def test_bots_keep_their_lane_and_speed_if_told_so():
    objects = ObjectSettings(2, speed=0.5, lane_changes=False, random=False)
    env = RacerVectorEnv(load_track("wide-loop"), 1, objects=objects, max_steps=900)
    env.reset(seed=0, options={"lap_fraction": [0.5]})
    bots, rows = env._fleet.objects, np.arange(1)
    before = bots.along.copy()
    for _ in range(15 * 20):
        bots.drive(env.tracks[0], rows, 1 / 15)
    assert_allclose(bots.along, (before + 10.0) % env.tracks[0].length)
    assert_array_equal(bots.poses[0, :, 3], [1, -1])
    changing = RacerVectorEnv(env.tracks[0], 1, objects=replace(objects, lane_changes=True))
    changing.reset(seed=0, options={"lap_fraction": [0.5]})
    waits = changing._fleet.objects.waits
    assert 3 <= waits.min() < waits.max() <= 5


def test_training_starts_and_directions_follow_the_card():
    assert racer().start_options(1, 3, 1, False) == {"lap_fraction": [0, 0.05, 0.1]}
    far = racer(start_offset=0.9, start_spacing=0.1, direction="reverse")
    options = far.start_options(2, 2, 2, False)
    assert_allclose(options["lap_fraction"], [0.1, 0.2, 0.1, 0.2])
    assert options["reverse"] == [True] * 4
    assert far.start_options(1, 2, None, False) == {
        "lap_fraction": [0, 0.5], "reverse": [True, True]
    }  # fmt: skip
    still = racer(start_spacing=0.0, start_offset=0.3).start_options(1, 2, 7, False)
    assert still == {"lap_fraction": [0.3, 0.3]}


def test_by_turns_every_place_is_driven_both_ways():
    env, met = racer(direction="alternate"), {}
    for iteration in (1, 2):
        options = env.start_options(1, 20, iteration, False)
        assert sum(options["reverse"]) == 10
        for place, reverse in zip(options["lap_fraction"], options["reverse"], strict=True):
            met.setdefault(round(place, 3) % 1, set()).add(reverse)
    assert len(met) == 20
    assert all(ways == {False, True} for ways in met.values())
    assert "reverse" not in env.start_options(1, 20, None, False)


def test_looks_are_random_in_training_alone_and_anew_in_each_episode():
    env = racer(random_light=0.3, random_colours=0.1)
    options = {"lap_fraction": [0.2, 0.2]}
    plain = racer().make(2, False, None, True).reset(seed=[3, 4], options=options)[0]
    tried = env.make(2, False, None, False).reset(seed=[3, 4], options=options)[0]
    assert_array_equal(tried, plain)
    cars = env.make(2, False, None, True)
    looks = [cars.reset(seed=seeds, options=options)[0] for seeds in ([3, 4], None, [3, 5])]
    assert_array_equal(looks[0][0], looks[2][0])  # of its own seed
    for one, other in ((looks[0][0], looks[0][1]), (looks[0], looks[1]), (looks[0][0], plain[0])):
        assert np.abs(one.astype(int) - other).mean() > 2
    alone = env.make(1, False, None, True).reset(seed=[3], options={"lap_fraction": [0.2]})[0]
    assert_array_equal(alone[0], looks[0][0])


def test_grey_levels_move_no_farther_than_told():
    rng = np.random.default_rng(0)
    assert_array_equal(RandomAppearance().table(rng), np.arange(256))
    tables = np.stack([RandomAppearance(0.0, 0.1).table(rng) for _ in range(200)]).astype(int)
    moved = tables[:, KNOTS.astype(int)] - KNOTS
    assert np.abs(moved).max() <= 26
    assert moved[:, 1:-1].min() < -20
    assert moved[:, 1:-1].max() > 20
    light = np.stack([RandomAppearance(0.5, 0.0).table(rng)[100] for _ in range(200)])
    assert 50 <= light.min() < 60
    assert 140 < light.max() <= 150


@pytest.mark.parametrize("training_noise", [False, True])
def test_training_has_the_noise_of_evaluations_where_told(training_noise):
    from repaint_cli.learn.rollout.collect import start
    from repaint_cli.learn.seeding import Purpose

    card = read_task("racer-inner").with_settings([
        f"env.training_noise={str(training_noise).lower()}", "eval.noise=none"
    ])  # fmt: skip
    env, obs = start(card, [0], 1, Purpose.TRAIN, 1)
    _, calm = start(card, [0], 1, Purpose.EVALUATE, 1)
    assert (255 in obs) == training_noise  # salt and pepper
    assert 255 not in calm
    env.close()


# Races


def test_a_race_goes_on_over_the_line_and_counts_laps():
    env = RacerVectorEnv(load_track("wide-loop"), 1, race=RaceRules(laps=2), max_steps=3000)
    env.reset(seed=0, options={"lap_fraction": [0.0]})
    laps, speeds, ended = [], [], False
    while not ended:
        _, _, terminated, truncated, info = env.step(along_the_road(env))
        laps.append(int(info["laps"][0]))
        speeds.append(float(info["speed"][0]))
        ended = bool(terminated[0] or truncated[0])
    first = laps.index(1)
    assert laps[-1] == 2
    assert info["status"][0] == LAP_COMPLETE
    assert speeds[first + 1] > 0.8  # it does not stop at the line
    assert first + 1 == pytest.approx(len(laps) / 2, rel=0.03)
    assert info["resets"][0] == info["penalties"][0] == 0


def test_a_car_off_the_road_is_put_back_in_the_nearer_lane_and_pays():
    env = RacerVectorEnv(load_track("wide-loop"), 1, race=RaceRules(off_track_penalty=4.0))
    env.reset(seed=0, options={"lap_fraction": [0.0]})
    for _ in range(30):
        *_, info = env.step(along_the_road(env))
    before = info["progress"][0]
    heading = info["heading"][0] - np.pi / 2
    env._fleet.states[0, :2] += 1.5 * np.array([np.cos(heading), np.sin(heading)])  # to the right
    _, _, terminated, _, info = env.step(along_the_road(env))
    assert info["status"][0] == OFF_TRACK
    assert not terminated[0]
    assert (info["resets"][0], info["penalties"][0]) == (1, 4.0)
    assert env._fleet.states[0, 3] == 0
    *_, info = env.step(along_the_road(env))
    assert info["wheels_on"][0] == 4
    assert info["lane"][0] == -1  # the outer one is the right one
    assert info["progress"][0] == pytest.approx(before, abs=4)
    for _ in range(20):
        *_, info = env.step(along_the_road(env))
    assert info["status"][0] == 0
    assert info["progress"][0] > before


def test_a_car_that_crashes_is_put_behind_the_box_in_the_other_lane():
    rules = RaceRules(crash_penalty=3.0, reset_behind=0.7)
    env = RacerVectorEnv(load_track("wide-loop"), 1, objects=replace(BOXES, n=1), race=rules)
    env.reset(seed=0, options={"lap_fraction": [0.0]})
    steps = 0
    while not info_of(env)["penalties"][0]:  # the box is in the inner lane, 2 m on
        env.step(along_the_road(env, aims=0.25))
        steps += 1
        assert steps < 100
    fleet = env._fleet
    along = fleet.lap_fractions[0] * fleet.tracks[0].length
    assert along == pytest.approx(2.0 - 0.7 - BOXES.body[0] / 2 + 0.14, abs=0.03)
    params = env.params(0)
    assert params["is_left_of_center"] is False
    assert params["is_crashed"] is False
    assert info_of(env)["penalties"][0] == 3.0


def info_of(env):
    return env._race.report()


def test_a_race_is_over_after_the_last_reset():
    env = RacerVectorEnv(load_track("wide-loop"), 1, race=RaceRules(max_resets=1))
    env.reset(seed=0, options={"lap_fraction": [0.0]})
    ends = []
    for _ in range(2):
        env._fleet.states[0, :2] += 50.0
        _, _, terminated, _, info = env.step(along_the_road(env))
        ends.append(bool(terminated[0]))
    assert ends == [False, True]
    assert info["resets"][0] == 1  # the second mishap ends it
    assert info["penalties"][0] == 10.0


def test_the_races_table_and_record(repaint, home, tmp_path):
    said = repaint(
        "eval", "racer-inner", "--race", "--episodes", "2", "--set", "eval.laps=2", "--set",
        "eval.noise=none",
    )  # fmt: skip
    assert said.code == 0, said.err
    assert "race of 2 laps" in said.out
    row = said.out.splitlines()[2]  # in one line of 80 columns
    assert "2 of 2" in row
    assert row.rstrip().endswith("[0, 0]")
    assert "2 of 2" in said.out
    (record,) = tmp_path.glob("runs/racer-inner/eval-race-*/eval.json")
    found = json.loads(record.read_text())
    first, second = found["lap_times"][0]
    assert first == second  # the same race twice: there is no noise
    assert len(first) == 2
    assert sum(first) == pytest.approx(found["lengths"][0][0] / 15)
    assert first[1] < first[0]  # which begins at rest
    assert found["resets"] == found["penalties"] == [[0, 0]]
    assert found["env"]["race"]["laps"] == 2


def test_a_path_breaks_where_a_car_is_put_back_and_every_mishap_is_marked(home, monkeypatch):
    from repaint_cli.envs.racer import figures

    shown = []
    monkeypatch.setattr(figures, "plot_racer", lambda panels, *_: shown.extend(panels))
    xy = np.array([[[0, 0.5], [1, 0.5], [9, 9], [1, 5], [2, 5]]], float)  # left at (9, 9)
    status = np.array([0, 0, OFF_TRACK, 0, CRASHED], float)[:, None, None]
    boxes = np.tile([2.0, 1.0, 0.0], (5, 1, 1, 1, 1))
    raced = Episodes(
        returns=np.ones((1, 1)), lengths=np.full((1, 1), 5), terms=np.zeros((1, 1, 1)),
        rewards=np.zeros((5, 1, 1)), actions=np.zeros((5, 1, 1)), env_seeds=[0], targets=None,
        paths=xy[None], records={"status": status, "progress": status, "speed": status,
                                 "objects": boxes},
    )  # fmt: skip
    figures.draw_paths(("oval",), [("a", raced)], home / "p.png", "t", ("speed", ""), (0.4, 0.2))
    (panel,) = shown
    assert_array_equal(np.isnan(panel.xy[0, :, 0]), [False, False, False, True, False])
    assert_array_equal(panel.exits, [[9, 9]])
    assert_array_equal(panel.crashes, [[2, 5]])
    assert_allclose(panel.boxes, [[[1.8, 0.9], [2.2, 0.9], [2.2, 1.1], [1.8, 1.1]]])
    passed, _ = sweep(panel.xy, np.ones((1, 5)), np.zeros(2), np.full(2, 10.0))
    rows, columns = passed.shape
    assert passed[7 * rows // 10, 5 * columns // 10] == 0  # on the way that it was carried back
    assert passed[7 * rows // 10, 55 * columns // 100] == 0
    assert passed[5 * rows // 100, 5 * columns // 100] == 1  # where it drove
    assert "objects" in racer(n_boxes=1).paths.records  # which evaluations keep for that


@pytest.mark.parametrize(("width", "intervals"), [(80, 3), (70, 1), (60, 0)])
def test_a_narrow_table_has_fewer_intervals_and_breaks_no_row(width, intervals):
    rng = np.random.default_rng(0)
    evaluated = episodes(rng.normal(300, 50, (1, 6)), rng.uniform(20, 99, (1, 6)), [[20.0] * 6])
    text = StringIO()
    shown = table("name", [7], racer(), evaluated)
    Console(file=text, width=width).print(shown)
    _, head, row, *more = text.getvalue().splitlines()
    assert not more
    assert row.count("[") == intervals
    assert ("[95 % CI]" in head) == (intervals > 0)
    assert "crashes, %" in head


def test_a_races_time_limit_does_not_grow_when_it_is_settled():
    race = racer().racing(read_task("racer-inner").eval)
    assert race.longest_episode() == 3 * racer().longest_episode()
    assert race.settled().longest_episode() == race.longest_episode()


def test_only_races_are_raced(repaint, home):
    said = repaint("eval", "reacher", "--race")
    assert said.code == CardError.exit_code
    assert "expected --race with a racing task" in said.err


# Which policy is the best


def episodes(returns, progress, lap_times):
    """Two policies with two episodes each, one step long."""
    shape = np.shape(returns)
    known = {"progress": progress, "lap_time": lap_times, "status": np.zeros(shape)}
    records = {name: np.array(rows, float)[None] for name, rows in known.items()}
    return Episodes(
        returns=np.array(returns, float), lengths=np.ones(shape, int), terms=np.zeros((*shape, 1)),
        rewards=np.zeros((1, *shape)), actions=np.zeros((1, *shape)), records=records,
        env_seeds=[0] * 4, paths=None, targets=None,
    )  # fmt: skip


def test_an_open_track_has_no_races():
    with pytest.raises(ValueError, match="expected a closed track for races"):
        RacerVectorEnv(open_track(), 1, race=RaceRules())


def open_track():
    rows = np.load(TRACKS / "oval.npy")[:40]
    return Track.from_waypoints(rows, "open")


@pytest.mark.parametrize(("best", "wanted"), [("return", 0), ("progress", 1), ("lap_time", 0)])
def test_the_best_policy_is_chosen_by_what_the_card_says(best, wanted):
    evaluated = episodes([[9, 9], [1, 1]], [[100, 60], [90, 90]], [[20, 5], [10, 10]])
    own = scores(evaluated, best)
    assert own.index(max(own)) == wanted
    progress = RunProgress()
    progress.add_evaluation(1, evaluated, best)
    assert progress.best == (1, wanted)
    progress.add_evaluation(2, evaluated, best)
    assert progress.best == (1, wanted)  # an equal one later is no better


def test_more_laps_are_better_than_a_faster_one():
    evaluated = episodes([[0, 0], [0, 0]], [[100, 100], [100, 50]], [[30, 30], [10, 10]])
    own = scores(evaluated, "lap_time")
    assert own[0] > own[1]
    slower = episodes([[0, 0], [0, 0]], [[100, 100], [100, 100]], [[30, 30], [10, 10]])
    assert scores(slower, "lap_time")[0] < scores(slower, "lap_time")[1]


# Bad input


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["env.n_boxes=2", "env.n_bots=2"], "expected n_bots or n_boxes"),
        (["env.n_boxes=2", "env.object_places=[[0.2,1]]"], "as many object_places as n_boxes"),
        (["env.bot_waits=[5,3]"], "the shorter one first, found [5, 3]"),
        (["env.box_size=[0.3,0.4,0]"], "expected three lengths above 0"),
        (["env.object_places=[[0.2,2]]"], "expected -1 or 1, found 2"),
        (["env.direction=backwards"], "expected 'forward', 'reverse' or 'alternate'"),
    ],
)
def test_settings_that_cannot_be_are_refused_in_a_line(settings, words):
    with pytest.raises(CardError) as error:
        read_task("racer-inner").with_settings(settings)
    assert words in str(error.value)
    assert len(str(error.value)) < 250


def test_only_a_race_is_best_by_progress():
    with pytest.raises(CardError, match=r"but with a racing task, found .progress."):
        read_task("reacher").with_settings(["eval.best=progress"])


def test_a_road_without_a_way_past_is_noticed():
    assert racer(n_boxes=2).doubts() == []
    (doubt,) = racer(n_boxes=2, box_size=(0.3, 0.7, 0.2)).doubts()
    assert "no car can pass a box where the road is" in doubt
