"""Four bots, two cameras and a lidar: the multi-car environment."""

from pathlib import Path

import numpy as np
import pytest
from gymnasium.spaces import Dict
from gymnasium.vector import AutoresetMode
from numpy.testing import assert_allclose, assert_array_equal

from repaint_cli.envs.racer.dynamics.bots import SIDE, X, Y
from repaint_cli.envs.racer.dynamics.objects import ObjectSettings
from repaint_cli.envs.racer.env import RacerVectorEnv
from repaint_cli.envs.racer.names import STATUS
from repaint_cli.envs.racer.sight.noise import Noise
from repaint_cli.envs.racer.track.geometry import NDIST
from repaint_cli.envs.racer.track.track import Track

TRACKS = Path(__file__).parents[1] / "tasks" / "racer" / "tracks"
TERMS = ("clear", "hazard", "camlane")
STRAIGHT_FAST = 7


def make(n=2, **kwargs):
    track = Track.from_waypoints(np.load(TRACKS / "wide-loop.npy"), "wide-loop")
    given = {"sensors": "stereo+lidar", "objects": ObjectSettings(4), "max_steps": 60} | kwargs
    return RacerVectorEnv(track, n, **given)


def played(env, seed, steps=40):
    """The observations, rewards and infos of a car in some steps of any actions, as bytes."""
    obs, _ = env.reset(seed=seed)
    outputs = [{name: part[0].tobytes() for name, part in obs.items()}]
    actions = np.random.default_rng(1).integers(10, size=(steps, 1)).repeat(env.num_envs, 1)
    for action in actions:
        obs, reward, terminated, truncated, info = env.step(action)
        outputs.append({name: part[0].tobytes() for name, part in obs.items()})
        outputs.append((reward[0], terminated[0], truncated[0], *(info[k][0] for k in TERMS)))
    env.close()
    return outputs


def test_observations_are_in_their_space_and_new_every_step():
    env = make()
    assert isinstance(env.single_observation_space, Dict)
    first, _ = env.reset(seed=3)
    before = {name: part.copy() for name, part in first.items()}
    for _ in range(5):
        obs, *_ = env.step(np.full(2, STRAIGHT_FAST))
        assert env.observation_space.contains(obs)
    assert {name: part.shape for name, part in obs.items()} == {
        "camera": (2, 120, 160, 2), "lidar": (2, 64)
    }  # fmt: skip
    for name in first:
        assert_array_equal(first[name], before[name])
    assert (obs["camera"] != first["camera"]).any()


@pytest.mark.parametrize("noise", [None, Noise()])
def test_a_car_and_its_bots_do_not_depend_on_neighbours_or_threads(noise):
    alone = played(make(1, noise=noise), seed=[11])
    assert played(make(3, noise=noise), seed=[11, 5, 6]) == alone
    assert played(make(4, noise=noise, threads=2), seed=[11, 5, 6, 7]) == alone
    assert played(make(1, noise=noise), seed=[12]) != alone


def test_two_eyes_are_the_one_camera_moved_aside():
    one, two = (
        make(1, sensors="camera", objects=ObjectSettings()),
        make(1, sensors="stereo", objects=ObjectSettings()),
    )
    (mono, _), (stereo, _) = one.reset(seed=1), two.reset(seed=1)
    assert stereo.shape == (1, 120, 160, 2)
    left, right = (stereo[0, ..., k].astype(float) for k in (0, 1))
    middle = mono[0, ..., 0].astype(float)
    assert np.abs(middle - (left + right) / 2).mean() < np.abs(left - right).mean()


def place_bot(env, ahead):
    """Put the first bot before or behind a car that has just started, the others far away."""
    fleet = env._fleet
    fleet.objects.along[:] = fleet.measures[0, NDIST] * fleet.tracks[0].length + 10.0
    fleet.objects.along[0, 0] = fleet.measures[0, NDIST] * fleet.tracks[0].length - 0.14 + ahead
    fleet.objects.drive(fleet.tracks[0], np.arange(env.num_envs), 0.0)


@pytest.mark.parametrize("crash", ["at-fault", "any"])
def test_driving_into_a_bot_is_a_crash_and_a_failure(crash):
    env = make(1, crash=crash, autoreset_mode=AutoresetMode.DISABLED)
    env.reset(seed=2, options={"lap_fraction": [0.3]})
    env._fleet.states[0, :2] = env._fleet.tracks[0].pose_at(np.array(0.3))[0]
    place_bot(env, 0.7)
    env._fleet.objects.poses[0, 0, :2] = env._fleet.states[0, :2] + 0.45 * np.array(
        [np.cos(env._fleet.states[0, 2]), np.sin(env._fleet.states[0, 2])]
    )
    env._fleet.objects.drive = lambda *_: None
    for _ in range(40):
        *_, terminated, truncated, info = env.step(np.full(1, STRAIGHT_FAST))
        if terminated[0]:
            break
    assert STATUS[int(info["status"][0])] == "crashed"
    assert info["fail"][0] == 1
    assert info["hazard"][0] == 1
    assert info["clear"][0] == 0
    assert not truncated[0]


@pytest.mark.parametrize(("crash", "ends"), [("at-fault", False), ("any", True)])
def test_being_hit_from_behind_ends_only_by_the_stricter_rule(crash, ends):
    env = make(1, crash=crash, autoreset_mode=AutoresetMode.DISABLED)
    env.reset(seed=2, options={"lap_fraction": [0.3]})
    fleet, bots = env._fleet, env._fleet.objects
    place_bot(env, -0.30)
    bots.poses[0, 0, :3] = fleet.states[0, :3] - [
        0.30 * np.cos(fleet.states[0, 2]), 0.30 * np.sin(fleet.states[0, 2]), 0.0
    ]  # fmt: skip
    drive, bots.drive = bots.drive, lambda *_: None
    _, _, terminated, *_ = env.step(np.full(1, 2))
    assert terminated[0] == ends
    if not ends:
        bots.drive, before = drive, bots.along.copy()
        for _ in range(15):
            bots.drive(fleet.tracks[0], np.arange(1), 1 / 15)
        assert_allclose(bots.along, before)  # they wait for the car to go


def test_terms_follow_the_bots():
    env = make(8, autoreset_mode=AutoresetMode.DISABLED)
    env.reset(seed=5)
    fleet, rng = env._fleet, np.random.default_rng(0)
    seen = {name: set() for name in TERMS}
    for _ in range(55):
        driving = fleet.status == 0
        *_, info = env.step(rng.integers(10, size=8))
        gaps = np.hypot(
            *(fleet.objects.poses[..., :2] - fleet.states[:, None, :2]).transpose(2, 0, 1)
        )
        assert_array_equal(info["clear"][driving], (gaps.min(1) > 0.8)[driving])
        for name in TERMS:
            seen[name] |= set(info[name][driving])
    assert seen["clear"] == {0.0, 1.0}
    assert seen["camlane"] == {0.0, 1.0}


def test_a_car_starts_in_the_lane_that_a_near_bot_does_not_go_to():
    env, sides = make(64), []
    env.reset(seed=0, options={"lap_fraction": np.linspace(0, 1, 64, endpoint=False)})
    fleet = env._fleet
    along = np.linspace(0, 1, 64, endpoint=False) * fleet.tracks[0].length
    for n in range(64):
        apart = np.abs(fleet.objects.along[n] - along[n])
        apart = np.minimum(apart, fleet.tracks[0].length - apart)
        centre = fleet.tracks[0].pose_at(np.array(along[n] / fleet.tracks[0].length))[0]
        off = np.hypot(*(fleet.states[n, :2] - centre))
        if apart.min() < 1:
            near = fleet.objects.poses[n, apart.argmin()]
            assert off == pytest.approx(fleet.tracks[0].width / 4, rel=0.05)
            assert np.hypot(near[X] - fleet.states[n, 0], near[Y] - fleet.states[n, 1]) > 0.3
            sides.append(near[SIDE])
        else:
            assert off == pytest.approx(0, abs=1e-9)
    assert set(sides) == {-1.0, 1.0}


def test_a_lidar_reads_only_what_is_behind_within_a_metre():
    env = make(1, range_min=0.2)
    env.reset(seed=2, options={"lap_fraction": [0.3]})
    assert env.single_observation_space["lidar"].low.min() == pytest.approx(0.2)
    place_bot(env, -0.7)
    obs, *_ = env.step(np.full(1, 2))
    assert obs["lidar"].min() < 0.7
    assert obs["lidar"].max() == 1


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (
            {"sensors": "eyes"},
            "unknown sensors 'eyes'; choose one of camera, camera.lidar, stereo, stereo",
        ),
        ({"crash": "never"}, "unknown crash 'never'; choose one of at-fault, any"),
    ],
)
def test_what_it_cannot_be(wrong, message):
    with pytest.raises(ValueError, match=message):
        make(**wrong)
