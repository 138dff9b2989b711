import csv
from pathlib import Path

import numpy as np
import pytest
import racer_reference as reference
from numpy.testing import assert_allclose, assert_array_equal

from repaint_cli.envs.racer.dynamics import progress as progresses
from repaint_cli.envs.racer.dynamics import rules
from repaint_cli.envs.racer.dynamics.car import CAR_POINTS, FRONT_OFFSET
from repaint_cli.envs.racer.names import STATUS
from repaint_cli.envs.racer.track.geometry import CENTRE_GAP, NDIST, ROAD_WIDTH, WHEELS_ON, measure
from repaint_cli.envs.racer.track.track import Track

ROOT = Path(__file__).parents[1]
REAL = ROOT.parent / "shared" / "data" / "deepracer"


def judged(wheels=4, progress=50.0, steps=1, still=0, backwards=0, crashed=False):
    measures = np.zeros((1, 6))
    measures[0, WHEELS_ON] = wheels
    counters = progresses.Counters(*(np.array([n]) for n in (steps, still, backwards)))
    crashes = np.array([crashed])
    return STATUS[rules.status_of(measures, np.array([progress]), counters, 100, crashes)[0]]


@pytest.mark.parametrize(
    ("facts", "status"),
    [
        ({}, "in_progress"),
        ({"wheels": 1}, "in_progress"),
        ({"wheels": 0}, "off_track"),
        ({"wheels": 0, "progress": 99.9}, "off_track"),
        ({"wheels": 0, "progress": 100.0, "steps": 100}, "lap_complete"),
        ({"progress": 100.0, "steps": 100}, "lap_complete"),
        ({"crashed": True, "progress": 100.0}, "crashed"),
        ({"crashed": True, "wheels": 0}, "off_track"),
        ({"still": 14}, "in_progress"),
        ({"still": 15, "steps": 100}, "immobilized"),
        ({"backwards": 14}, "in_progress"),
        ({"backwards": 15, "steps": 100}, "reversed"),
        ({"steps": 99}, "in_progress"),
        ({"steps": 100}, "time_up"),
    ],
)
def test_status(facts, status):
    assert judged(**facts) == status


def test_counters_count_in_a_row():
    counters = progresses.Counters.zeros(3)
    rows = np.array([0, 2])
    for moved, gained in (([0.0, 0.1], [0.0, -1.0]), ([0.0003, 0.1], [0.1, -1.0])):
        counters.count(rows, np.array(moved), np.array(gained))
    assert_array_equal(counters.steps, [2, 0, 2])
    assert_array_equal(counters.still, [2, 0, 0])
    assert_array_equal(counters.backwards, [0, 0, 2])
    counters.count(rows, np.array([0.001, 0.0]), np.array([-0.1, 0.0]))
    assert_array_equal(counters.still, [0, 0, 1])
    assert_array_equal(counters.backwards, [1, 0, 0])
    counters.clear(np.array([2]))
    assert_array_equal(counters.steps, [3, 0, 0])


@pytest.mark.parametrize(
    ("ndist", "start", "previous", "progress"),
    [
        (0.30, 0.25, 4.0, 5.0),
        (0.02, 0.95, 6.0, 7.0),  # over the start line
        (0.24, 0.25, 0.0, -1.0),  # behind the start
        (0.26, 0.25, 99.5, 100.0),  # past the start again: a lap, and no more than a lap
        (0.25, 0.25, 0.0, 0.0),
    ],
)
def test_progress(ndist, start, previous, progress):
    answer = progresses.progress_since(*(np.array([value]) for value in (ndist, start, previous)))
    assert_allclose(answer, progress, atol=1e-9)


def test_keep_needs_all_wheels_and_room():
    def keep(wheels, gap):
        measures = np.zeros((1, 6))
        measures[0, [WHEELS_ON, CENTRE_GAP, ROAD_WIDTH]] = wheels, gap, 0.8
        return rules.reward_terms(measures, np.zeros(1), np.zeros(1, int))["keep"][0]

    assert [keep(4, 0.0), keep(4, 0.34), keep(4, 0.36), keep(3, 0.0)] == [1, 1, 0, 0]


@pytest.mark.parametrize("clockwise", [False, True])
def test_where_a_car_stands_agrees_with_the_reference(clockwise):
    waypoints = np.load(ROOT / "tasks" / "racer" / "tracks" / "reinvent-like.npy")
    road = Track.from_waypoints(waypoints * np.tile([-1.0 if clockwise else 1.0, 1.0], 3), "road")
    rng = np.random.default_rng(0)
    low, high = road.outer.min(axis=0), road.outer.max(axis=0)
    states = np.zeros((400, 5))
    states[:, :2] = rng.uniform(low, high, size=(400, 2))
    states[:200, :2] = road.pose_at(rng.random(200))[0] + rng.normal(0, 0.3, (200, 2))
    states[:, 2] = rng.uniform(-np.pi, np.pi, 400)
    fronts, measures = np.zeros((400, 2)), np.zeros((400, 6))
    measure(np.arange(400), states, CAR_POINTS, *road.lines, *road.outline, fronts, measures)
    assert_allclose(measures, reference.locate(road, states), rtol=0, atol=1e-9)


@pytest.mark.skipif(not REAL.is_dir(), reason="the DeepRacer logs are not here")
@pytest.mark.parametrize("kind", ["training-12", "evaluation-0"])
def test_progress_and_wheels_are_those_of_real_logs(kind):
    base = np.load(REAL / "tracks" / "reinvent_base.npy")
    track = Track.from_waypoints(base, "reinvent_base")
    with (REAL / "logs" / f"drfc1-{kind}-iteration.csv").open() as file:
        rows = list(csv.DictReader(file))
    yaw = np.deg2rad([float(row["yaw"]) for row in rows])
    front = np.array([[float(row["X"]), float(row["Y"])] for row in rows])
    heading = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    states = np.hstack([front - FRONT_OFFSET * heading, yaw[:, None], np.zeros((len(rows), 2))])
    measures = reference.locate(track, states)
    logged = np.array([float(row["progress"]) for row in rows])
    previous = start = 0.0
    wrong = 0
    for row, measured, percent in zip(rows, measures, logged, strict=True):
        if row["episode_status"] == "prepare":  # episodes start at multiples of 0.05 laps
            previous, start = 0.0, np.round((measured[NDIST] - percent / 100) * 20) / 20
        ours = progresses.progress_since(
            *(np.array([value]) for value in (measured[NDIST], start, previous))
        )[0]
        wrong += abs(ours - percent) > 1e-3
        previous = ours if ours < 100 else 0.0  # an evaluation drives lap after lap
    assert wrong == 0
    all_on = np.array([row["all_wheels_on_track"] == "True" for row in rows])
    assert np.mean((measures[:, WHEELS_ON] == 4) == all_on) >= 0.9997
    off = np.array([row["episode_status"] == "off_track" for row in rows])
    assert np.mean((measures[:, WHEELS_ON] == 0) == off) >= 0.999
