from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import racer_reference as reference
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from repaint_cli.envs.racer.dynamics import bots
from repaint_cli.envs.racer.dynamics.bots import SIDE, YAW, X, Y
from repaint_cli.envs.racer.dynamics.objects import Objects, ObjectSettings, places
from repaint_cli.envs.racer.track.track import Track

TRACKS = Path(__file__).parents[1] / "tasks" / "racer" / "tracks"
STEP = 1 / 15


def load(name):
    return Track.from_waypoints(np.load(TRACKS / f"{name}.npy"), name)


@pytest.fixture(scope="module", params=["wide-loop", "oval"])
def track(request):
    return load(request.param)


def started(track, n=3, n_bots=4, seed=0):
    some = Objects(n, ObjectSettings(n_bots))
    some.start(track, np.arange(n), [np.random.default_rng(seed + i) for i in range(n)])
    return some


@given(seed=st.integers(0, 10_000), n_bots=st.integers(1, 4))
def test_bots_start_two_metres_apart_where_there_is_room(seed, n_bots):
    where, _ = places(ObjectSettings(n_bots), 23.0, np.random.default_rng(seed))
    assert where[0] >= 2
    assert where[-1] <= 22
    assert all(b - a >= 2 for a, b in pairwise(where))


def test_a_place_is_drawn_from_all_the_room_it_has():
    one = ObjectSettings(1)
    drawn = [places(one, 23.0, np.random.default_rng(seed))[0][0] for seed in range(500)]
    assert min(drawn) < 2.2
    assert max(drawn) > 21.8


def test_a_bots_place_is_midway_between_centre_line_and_border(track):
    road = (track.centre, track.distances, track.inner, track.outer)
    for i in (0, 5, len(track.centre) - 2):
        for side, border in ((1.0, track.inner), (-1.0, track.outer)):
            found = bots.lane_point(*road, track.distances[i], side)
            assert_allclose(found, (track.centre[i] + border[i]) / 2, atol=1e-12)
        assert_allclose(bots.lane_point(*road, track.distances[i], 0.0), track.centre[i])
    assert_allclose(
        bots.lane_point(*road, track.length + 1.0, 1.0), bots.lane_point(*road, 1.0, 1.0)
    )


def test_the_kernel_and_its_slow_twin_agree(track):
    some, rng = started(track), np.random.default_rng(3)
    for _ in range(200):
        some.drive(track, np.arange(3), rng.uniform(0, 0.3))
        expected = reference.bot_points(track, some.along, some.poses[..., SIDE])
        assert_allclose(some.poses[..., :2], expected, atol=1e-12)


def test_bots_advance_at_their_speed_and_wrap_at_the_start_line(track):
    some = started(track, n=1, n_bots=1)
    before = some.along.copy()
    for _ in range(15 * 60):
        some.drive(track, np.arange(1), STEP)
    travelled = 0.2 * 60
    assert_allclose(some.along, (before + travelled) % track.length, atol=1e-9)


def test_a_lane_change_takes_a_metre_and_turns_smoothly(track):
    some = started(track, n=1, n_bots=1, seed=2)
    poses, along = [], []
    for _ in range(15 * 30):
        some.drive(track, np.arange(1), STEP)
        poses.append(some.poses[0, 0].copy())
        along.append(some.along[0, 0])
    poses = np.array(poses)
    changing = np.abs(poses[:, SIDE]) < 1
    runs = np.split(np.arange(len(changing)), np.flatnonzero(np.diff(changing)) + 1)
    whole = [run for run in runs[1:-1] if changing[run[0]]]
    waits = [run for run in runs[1:-1] if not changing[run[0]]]
    assert len(whole) >= 2
    for run in whole:
        assert len(run) * STEP * 0.2 == pytest.approx(1.0, abs=0.03)
        assert poses[run[0] - 1, SIDE] == -poses[run[-1] + 1, SIDE]
    assert all(3 - STEP <= len(run) * STEP <= 5.8 + 2 * STEP for run in waits)  # and two axles
    turned = np.abs(np.diff(np.unwrap(poses[:, YAW])))
    assert turned.max() < 0.06  # rad a step


def test_bots_head_where_they_go(track):
    some = started(track, n=2)
    before = some.poses.copy()
    some.drive(track, np.arange(2), 0.3)
    moved = some.poses - before
    went = np.arctan2(moved[..., Y], moved[..., X])
    off = np.angle(np.exp(1j * (went - (before[..., YAW] + some.poses[..., YAW]) / 2)))
    still_apart = np.abs(np.angle(np.exp(1j * (before[..., YAW] - some.poses[..., YAW])))) < 0.5
    assert np.abs(off[still_apart]).max() < 0.06


def test_a_pause_holds_them_for_two_seconds(track):
    some = started(track, n=2)
    before = some.along.copy()
    some.pause(np.array([1]))
    for _ in range(30):
        some.drive(track, np.arange(2), STEP)
    assert_allclose(some.along[1], before[1], atol=1e-9)
    assert_allclose((some.along[0] - before[0]) % track.length, 0.4, atol=1e-9)
    some.drive(track, np.arange(2), STEP)
    assert (some.along[1] != before[1]).all()


def test_a_cars_bots_depend_on_its_own_generator_alone(track):
    alone, among = started(track, n=1, seed=5), started(track, n=4, seed=2)
    for _ in range(300):
        alone.drive(track, np.arange(1), STEP)
        among.drive(track, np.arange(4), STEP)
    assert_array_equal(alone.poses[0], among.poses[3])
