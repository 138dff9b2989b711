"""The dictionary that DeepRacer's reward functions read."""

import csv
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from racer_reference import line_project, locate

from repaint_cli.envs.racer.deepracer.params import CarState, closest_waypoints, params_of
from repaint_cli.envs.racer.dynamics.car import FRONT_OFFSET
from repaint_cli.envs.racer.dynamics.objects import ObjectSettings
from repaint_cli.envs.racer.env import RacerVectorEnv
from repaint_cli.envs.racer.sight.noise import Noise
from repaint_cli.envs.racer.track.track import Track

ROOT = Path(__file__).parents[1]
REAL = ROOT.parent / "shared" / "data" / "deepracer"
FLAGS = [
    "all_wheels_on_track",
    "is_left_of_center",
    "is_reversed",
    "object_in_camera",
    "is_crashed",
    "is_offtrack",
]
NUMBERS = [
    "x",
    "y",
    "heading",
    "distance_from_center",
    "projection_distance",
    "progress",
    "steps",
    "speed",
    "steering_angle",
    "track_width",
    "track_length",
    "sim_time",
]
LISTS = [
    "waypoints",
    "closest_waypoints",
    "closest_objects",
    "objects_location",
    "objects_left_of_center",
    "objects_speed",
    "objects_heading",
    "objects_distance",
    "objects_distance_from_center",
]


def load(name):
    return Track.from_waypoints(np.load(ROOT / f"tasks/racer/tracks/{name}.npy"), name)


def driven(name="wide-loop", steps=5, reverse=False, n_bots=4, action=8, share=0.3):
    env = RacerVectorEnv(load(name), 1, sensors="stereo", objects=ObjectSettings(n_bots))
    env.reset(seed=4, options={"lap_fraction": [share], "reverse": [reverse]})
    for _ in range(steps):
        env.step(np.full(1, action))
    return env, env.params(0)


@pytest.mark.parametrize("n_bots", [0, 4])
def test_all_keys_are_there_in_plain_python(n_bots):
    _, params = driven(n_bots=n_bots)
    assert sorted(params) == sorted(FLAGS + NUMBERS + LISTS)
    for kind, names in ((bool, FLAGS), (float, NUMBERS), (list, LISTS)):
        assert {name for name in names if type(params[name]) is not kind} == set()
    for name in ("objects_location", "objects_speed", "objects_heading", "objects_distance"):
        assert len(params[name]) == n_bots


def test_commands_are_told_and_not_what_the_car_makes_of_them():
    env, params = driven(steps=2, action=9)
    assert (params["speed"], params["steering_angle"]) == (1.0, pytest.approx(30))
    assert env._fleet.states[0, 3] < 0.9
    assert (params["steps"], params["sim_time"]) == (2, pytest.approx(2 / 15))


@pytest.mark.parametrize("angle", [-30, -15, 0, 7.5, 12.3, 15, 30])
def test_the_steering_angle_is_the_listed_number(angle):
    env = RacerVectorEnv(load("oval"), 1, actions=[(angle, 1.0)])
    env.reset(seed=0)
    env.step(np.zeros(1, int))
    assert env.params(0)["steering_angle"] == angle


def test_noise_moves_the_car_and_not_what_is_reported():
    commands, cars = [], []
    for noise in (None, Noise(action=0.1)):
        env = RacerVectorEnv(load("oval"), 2, noise=noise)
        env.reset(seed=0)
        for t in range(12):
            env.step(np.array([t % 10, 9]))
            for row in range(2):
                told = env.params(row)
                commands.append((told["speed"], told["steering_angle"]))
        cars.append(env._fleet.states.copy())
        env.reset(seed=0)
        assert env.params(0)["speed"] == 0
    half = len(commands) // 2
    assert commands[:half] == commands[half:]
    assert {speed for speed, _ in commands} == {0.5, 1.0}
    assert not np.allclose(*cars)


@pytest.mark.parametrize("reverse", [False, True])
def test_the_driven_direction_rules_waypoints_and_sides(reverse):
    _, params = driven(reverse=reverse, n_bots=0)
    centre = load("wide-loop").centre
    assert_allclose(params["waypoints"], centre[::-1] if reverse else centre)
    before, after = (np.array(params["waypoints"][k]) for k in params["closest_waypoints"])
    way = after - before
    assert np.cos(np.arctan2(way[1], way[0]) - np.deg2rad(params["heading"])) > 0.9
    here = np.array([params["x"], params["y"]]) - before
    cross = way[0] * here[1] - way[1] * here[0]
    assert params["is_left_of_center"] == (cross > 0)
    assert params["is_reversed"] == reverse


def test_a_moved_list_does_not_come_back():
    env, params = driven()
    params["waypoints"].clear()
    params["objects_location"].clear()
    again = env.params(0)
    assert len(again["waypoints"]) > 100
    assert len(again["objects_location"]) == 4


def test_bots_are_told_by_place_side_and_order():
    env, params = driven(steps=60, action=2)
    bots, track = env._fleet.objects, load("wide-loop")
    near, _ = line_project(track.centre, bots.poses[0, :, :2])
    assert_allclose(
        params["objects_distance_from_center"],
        np.hypot(*(near - bots.poses[0, :, :2]).T), atol=0.02,
    )  # fmt: skip
    own = params["projection_distance"]
    ahead = [(d - own) % track.length for d in params["objects_distance"]]
    assert params["closest_objects"] == [int(np.argmax(ahead)), int(np.argmin(ahead))]
    sides = [bool(side > 0) for side in bots.poses[0, :, 3]]
    assert params["objects_left_of_center"] == sides  # the infield is on the left


def test_waypoints_wrap_at_the_start_line():
    track = load("oval")
    m = len(track.distances)
    assert closest_waypoints(track, 0.0) == [0, 1]
    assert closest_waypoints(track, float(track.distances[1])) == [1, 2]
    assert closest_waypoints(track, track.length - 1e-6) == [m - 2, m - 1]
    assert closest_waypoints(track, track.length) == [m - 1, 0]


def real_log(kind):
    track = Track.from_waypoints(np.load(REAL / "tracks" / "reinvent_base.npy"), "reinvent_base")
    with (REAL / "logs" / f"drfc1-{kind}-iteration.csv").open() as file:
        return track, list(csv.DictReader(file))


def follow_the_centre_line(params):
    """The rule those logs were paid by: three bands around the centre line."""
    share = params["distance_from_center"] / params["track_width"]
    return 1.0 if share <= 0.1 else 0.5 if share <= 0.25 else 0.1 if share <= 0.5 else 1e-3


@pytest.mark.skipif(not REAL.is_dir(), reason="the DeepRacer logs are not here")
@pytest.mark.parametrize("kind", ["training-12", "evaluation-0"])
def test_a_reward_function_pays_what_real_logs_say(kind):
    track, rows = real_log(kind)
    nothing = {
        "is_reversed": False, "chosen": np.zeros(2), "progress": 0.0, "steps": 1, "seconds": 0.0,
        "crashed": False, "poses": np.empty((0, 4)), "objects_along": np.empty(0),
        "objects_speed": 0.0,
        "encounter": np.zeros(6),
    }  # fmt: skip
    yaw = np.deg2rad([float(row["yaw"]) for row in rows])
    front = np.array([[float(row["X"]), float(row["Y"])] for row in rows])
    base = front - FRONT_OFFSET * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    states = np.hstack([base, yaw[:, None], np.zeros((len(rows), 2))])
    paid, logged = [], []
    for row, at, heading, measures in zip(rows, front, yaw, locate(track, states), strict=True):
        if row["episode_status"] != "prepare":  # whose reward is logged as 0
            now = CarState(road=track, front=at, yaw=heading, measures=measures, **nothing)
            paid.append(follow_the_centre_line(params_of(now)))
            logged.append(float(row["reward"]))
    assert len(set(logged)) >= 3
    assert paid == logged


@pytest.mark.skipif(not REAL.is_dir(), reason="the DeepRacer logs are not here")
@pytest.mark.parametrize("kind", ["training-12", "evaluation-0"])
def test_the_closest_waypoint_is_that_of_real_logs(kind):
    """Logs hold the nearer one of the two."""
    track, rows = real_log(kind)
    front = np.array([[float(row["X"]), float(row["Y"])] for row in rows])
    _, where = line_project(track.centre, front)
    along = np.interp(where, np.arange(len(track.distances)), track.distances)
    logged = np.array([int(row["closest_waypoint"]) for row in rows])
    assert_array_equal(track.nearest_waypoint(along), logged)
    for place, distance, nearest in zip(front, along, logged, strict=True):
        two = closest_waypoints(track, distance)
        gaps = [np.hypot(*(track.centre[k] - place)) for k in two]
        assert two[int(np.argmin(gaps))] == nearest
