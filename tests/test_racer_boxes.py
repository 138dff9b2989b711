"""Bots in the picture and on the lidar, and what a car has to do with them."""

from pathlib import Path

import numpy as np
import pytest
import racer_reference as reference
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from repaint_cli.envs.racer.dynamics import encounters
from repaint_cli.envs.racer.dynamics.encounters import (
    AT_FAULT,
    DISTANCE,
    HAZARDS,
    HIT,
    NEXT,
    NEXT_SEEN,
)
from repaint_cli.envs.racer.dynamics.objects import ObjectSettings
from repaint_cli.envs.racer.sight import boxes, camera, ground
from repaint_cli.envs.racer.sight.sensors import body_of
from repaint_cli.envs.racer.track.track import Track

TRACKS = Path(__file__).parents[1] / "tasks" / "racer" / "tracks"
LENGTH = 20.0
turns = st.floats(-np.pi, np.pi)


@pytest.fixture(scope="module")
def track():
    return Track.from_waypoints(np.load(TRACKS / "wide-loop.npy"), "wide-loop")


def car_at(x=0.0, y=0.0, yaw=0.0):
    return np.array([[x, y, yaw, 0.0, 0.0]])


CARTON = body_of(ObjectSettings(1, boxes=True))
BODIES = {"bot": boxes.BOT, "box": CARTON}


def drawn(state, poses, eye_offset=0.0, body=boxes.BOT):
    images = np.full((1, camera.HEIGHT, camera.WIDTH, 1), 200, np.uint8)
    row, lens = np.zeros(1, int), camera.lens()
    boxes.draw_rows(row, state, poses[None], body, eye_offset, lens, images, 0)
    return images[0, :, :, 0]


def met(state, poses, along=0.0, bots_along=(1.0, 5.0), body=encounters.CAR_BODY):
    out = np.zeros((1, 6))
    bots_along = np.array([bots_along[: len(poses)]])
    lens = camera.lens()
    where = np.array([along])
    encounters.meet(
        np.zeros(1, int), state, where, LENGTH, poses[None], bots_along, encounters.CAR_BODY, body,
        lens, out,
    )  # fmt: skip
    return out[0]


def scattered(rng, n_bots, reach=1.5):
    """Bots that neither hold the eye nor each other."""
    poses = np.empty((0, 4))
    while len(poses) < n_bots:
        pose = np.array([*rng.uniform(-reach, reach, 2), rng.uniform(-np.pi, np.pi), 1.0])
        apart = np.hypot(*(poses[:, :2] - pose[:2]).T).min(initial=9) > 0.4
        if apart and np.hypot(*pose[:2]) > 0.45:
            poses = np.vstack([poses, pose])
    return poses


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize(("eye_offset", "name"), [(0.0, "bot"), (0.03, "bot"), (0.03, "box")])
def test_boxes_are_drawn_as_their_slow_twin_draws_them(seed, eye_offset, name):
    body = BODIES[name]
    rng = np.random.default_rng(seed)
    poses = scattered(rng, 4)
    towards = np.arctan2(poses[0, 1], poses[0, 0]) + rng.uniform(-0.5, 0.5)
    state = car_at(*rng.uniform(-0.05, 0.05, 2), towards)
    fast = drawn(state, poses, eye_offset, body)
    slow = reference.draw_boxes(state[0], eye_offset, poses, np.full(fast.shape, 200.0), body)
    assert (fast != slow).mean() < 1e-3  # an edge may fall a pixel to the other side
    assert 0 < (slow != 200).mean() < 0.9


def test_a_box_ahead_shows_its_end_and_one_across_its_flank():
    ahead = drawn(car_at(), np.array([[0.8, 0.0, 0.0, 1.0]]))
    across = drawn(car_at(), np.array([[0.8, 0.0, np.pi / 2, 1.0]]))
    assert set(np.unique(ahead)) == {boxes.END_LUMA, 200}
    assert set(np.unique(across)) == {boxes.SIDE_LUMA, 200}
    assert (across != 200).sum() > 1.3 * (ahead != 200).sum()
    columns = np.flatnonzero((ahead != 200).any(0))
    assert columns[0] + columns[-1] == camera.WIDTH - 1  # in the middle


def test_the_nearer_box_hides_the_farther_one():
    near, far = [0.6, 0.0, 0.0, 1.0], [1.2, 0.05, np.pi / 2, 1.0]
    for poses in ([near, far], [far, near]):
        image = drawn(car_at(), np.array(poses))
        own = drawn(car_at(), np.array([near]))
        assert_array_equal(image[own != 200], own[own != 200])


def test_what_is_behind_is_not_in_the_picture():
    assert (drawn(car_at(), np.array([[-0.6, 0.0, 0.3, 1.0]])) == 200).all()


def test_stereo_sees_what_is_near_farther_apart(track):
    def shift(distance):
        box = np.array([[distance, 0.0, 0.0, 1.0]])
        places = [np.flatnonzero((drawn(car_at(), box, side) != 200).any(0)).mean()
                  for side in camera.STEREO_EYE_OFFSETS]  # fmt: skip
        return places[0] - places[1]

    for distance in (0.6, 1.2, 2.4):
        depth = distance - camera.CAMERA_X - boxes.BOT_LENGTH / 2
        assert shift(distance) == pytest.approx(0.06 * camera.FOCAL / depth, rel=0.15, abs=1)


@pytest.mark.parametrize("eye_offset", camera.STEREO_EYE_OFFSETS)
def test_each_eye_sees_the_road_as_its_slow_twin(track, eye_offset):
    picture = ground.ground_of(track)
    parts = (picture.levels, picture.origin, picture.field, camera.WALLS)
    place, heading = track.pose_at(np.array(0.3))
    state = np.array([*place, heading + 0.2, 0, 0])
    image = np.zeros((camera.HEIGHT, camera.WIDTH), np.uint8)
    camera.render(state, eye_offset, camera.row_table(), *parts, image)
    slow = reference.render(state, picture, eye_offset)
    assert (np.abs(image - slow) > 2).mean() < 0.01


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("name", BODIES)
def test_the_lidar_reads_what_its_slow_twin_reads(seed, name):
    body = BODIES[name]
    rng = np.random.default_rng(seed)
    state, poses = car_at(0.0, 0.0, rng.uniform(-np.pi, np.pi)), scattered(rng, 4, reach=1.0)
    ranges = np.zeros((1, 64))
    boxes.scan_rows(np.zeros(1, int), state, poses[None], body, ranges)
    assert_allclose(ranges[0], reference.scan(state[0], poses, body), atol=2e-4)
    assert ranges.min() < 0.9


def test_the_lidar_is_blind_ahead_and_sees_behind():
    ranges = np.zeros((2, 64))
    states = np.vstack([car_at(), car_at()])
    poses = np.array([[[0.6, 0.0, 0.0, 1.0]], [[-0.6, 0.0, 0.0, 1.0]]])
    boxes.scan_rows(np.arange(2), states, poses, boxes.BOT, ranges)
    assert (ranges[0] == 1).all()
    gap = 0.6 + boxes.BEAM_X - boxes.BOT_LENGTH / 2
    assert ranges[1].min() == pytest.approx(gap, abs=2e-3)
    assert ranges[1].argmin() in (31, 32)
    assert ranges[1, 0] == ranges[1, -1] == 1


@given(yaw=turns, x=st.floats(-3, 3), y=st.floats(-3, 3), turn=turns)
def test_lidar_and_view_turn_with_the_car(yaw, x, y, turn):
    cos, sin = np.cos(turn), np.sin(turn)
    poses = np.array([[x, y, yaw, 1.0]])
    turned = np.array([[x * cos - y * sin, x * sin + y * cos, yaw + turn, 1.0]])
    ranges = np.zeros((2, 64))
    states = np.vstack([car_at(), car_at(0, 0, turn)])
    boxes.scan_rows(np.arange(2), states, np.stack([poses, turned]), boxes.BOT, ranges)
    assert_allclose(ranges[0], ranges[1], atol=1e-9)


@pytest.mark.parametrize("seed", range(300))
def test_encounters_are_those_of_their_slow_twin(seed):
    rng = np.random.default_rng(seed)
    state = np.array([[*rng.normal(size=2), rng.uniform(-np.pi, np.pi), 0.0, 0.0]])
    reach = rng.choice([0.3, 0.6, 2.0])  # some touch, some are near, some are far
    poses = np.column_stack([
        state[0, :2] + rng.uniform(-reach, reach, (3, 2)), rng.uniform(-np.pi, np.pi, 3), np.ones(3)
    ])  # fmt: skip
    along, bots_along = rng.uniform(0, LENGTH), rng.uniform(0, LENGTH, 3)
    body = (encounters.CAR_BODY, ObjectSettings(3, boxes=True).body)[seed % 2]
    expected = reference.meet(state[0], along, LENGTH, poses, bots_along, body)
    assert_allclose(met(state, poses, along, bots_along, body), expected, atol=1e-9)


def test_distance_hazard_and_hit():
    far = np.array([[1.0, 0.0, 0.0, 1.0], [0.0, 2.0, 0.0, 1.0]])
    assert_allclose(met(car_at(), far)[[DISTANCE, HAZARDS, HIT]], [1, 0, 0])
    ahead = np.array([[0.45, 0.1, 0.0, 1.0]])
    assert_allclose(met(car_at(), ahead)[[HAZARDS, HIT]], [1, 0])
    beside = np.array([[0.1, 0.45, 0.0, 1.0]])
    assert_allclose(met(car_at(), beside)[[HAZARDS, HIT]], [0, 0])
    touching = np.array([[0.30, 0.0, 0.0, 1.0]])
    assert_allclose(met(car_at(), touching)[[HAZARDS, HIT, AT_FAULT]], [1, 1, 1])


@pytest.mark.parametrize(
    ("mine", "theirs", "at_fault"), [(1.0, 1.3, 1), (1.3, 1.0, 0), (19.8, 0.1, 1), (0.1, 19.8, 0)]
)
def test_the_one_behind_is_at_fault_also_across_the_start_line(mine, theirs, at_fault):
    pose = np.array([[0.3, 0.0, 0.0, 1.0]])
    found = met(car_at(), pose, along=mine, bots_along=(theirs,))
    assert_allclose(found[[HIT, AT_FAULT]], [1, at_fault])


def test_the_next_bot_is_the_first_ahead_on_the_track():
    poses = np.array([[1.0, 0.0, 0.0, 1.0], [-1.0, 0.0, 0.0, 1.0]])
    assert met(car_at(), poses, along=3.0, bots_along=(2.0, 4.0))[NEXT] == 1
    assert met(car_at(), poses, along=19.0, bots_along=(2.0, 18.5))[NEXT] == 0
    assert met(car_at(), poses, along=3.0, bots_along=(4.0, 2.0))[NEXT_SEEN] == 1
    assert met(car_at(), poses, along=3.0, bots_along=(2.0, 4.0))[NEXT_SEEN] == 0


def test_a_bot_is_seen_when_a_corner_is():
    edge = 0.9 * np.tan(camera.HORIZONTAL_VIEW / 2)
    for left, seen in ((edge + 0.08, 1), (edge + 0.4, 0), (-edge - 0.08, 1)):
        pose = np.array([[0.9 + camera.CAMERA_X, left, 0.0, 1.0]])
        assert met(car_at(), pose)[NEXT_SEEN] == seen
