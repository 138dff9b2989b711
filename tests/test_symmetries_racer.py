"""The racer in a mirror: a mirrored car on a mirrored track meets the same."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from repaint_cli.envs.racer.actions import ActionRanges
from repaint_cli.envs.racer.dynamics.car import ACTIONS
from repaint_cli.envs.racer.dynamics.objects import ObjectSettings
from repaint_cli.envs.racer.env import RacerVectorEnv
from repaint_cli.envs.racer.names import OBJECT_TERMS, TERMS
from repaint_cli.envs.racer.sight import sensors
from repaint_cli.envs.racer.sight.camera import WALLS, row_table
from repaint_cli.envs.racer.sight.ground import TEXEL, ground_of
from repaint_cli.envs.racer.simulator import RacerSimulator
from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.envs.racer.track.track import Track

N_CARS, N_STEPS = 8, 125  # 1,000 steps of a car
RANGES = ActionRanges(steering_angle=(-30, 30), speed=(0.5, 1.8))
CROSSWISE = np.array([1.0, -1.0])
CHANGED = {"y", "heading", "steering"}
"""What of a car's state changes its sign in the mirror."""


def mirrored_track(track):
    """The same road with y reflected; inside stays inside."""
    rings = [ring * CROSSWISE for ring in (track.centre, track.inner, track.outer)]
    return Track.from_waypoints(np.hstack(rings), f"mirrored {track.name}")


def show_in_mirror(env, track):
    """Have cars see the ground and the walls of a track reflected as they are painted.

    A mirrored track has a picture of its own, whose texels lie elsewhere, and walls whose grey says
    where they are.
    """
    ground = ground_of(track)
    levels = tuple(np.ascontiguousarray(level[::-1]) for level in ground.levels)
    top = ground.origin[1] + len(ground.levels[0]) * TEXEL
    x0, y0, x1, y1 = ground.field
    env._sensors.grounds = [(
        row_table(), levels, np.array([ground.origin[0], -top]), np.array([x0, -y1, x1, -y0]),
        np.ascontiguousarray(WALLS[[0, 1, 3, 2]]),
    )]  # fmt: skip


def simulator(**settings):
    return RacerSimulator(simulator="racer", **settings)


def symmetry_of(**settings):
    (found,) = simulator(**settings).symmetries()
    return found


def played(settings, symmetry):
    """Play random actions on a track and those of the mirror on its mirror image; yield both."""
    track = load_track(settings.pop("track"))
    settings["objects"] = ObjectSettings(settings.pop("n_bots", 0))
    env = RacerVectorEnv(track, N_CARS, **settings)
    mirror = RacerVectorEnv(mirrored_track(track), N_CARS, **settings)
    show_in_mirror(mirror, track)
    begin = {"seed": 0, "options": {"reverse": np.arange(N_CARS) % 2 == 1}}
    yield env.reset(**begin), mirror.reset(**begin)
    rng = np.random.default_rng(0)
    listed = "actions" not in settings

    def drawn():
        numbers = rng.uniform(-1.2, 1.2, (N_CARS, 2)).astype(np.float32)
        return rng.integers(10, size=N_CARS) if listed else numbers

    actions = drawn()
    for _ in range(N_STEPS):
        again = rng.random(N_CARS) < 0.7  # long enough to get somewhere
        actions = np.where(again if listed else again[:, None], actions, drawn())
        (obs, *_, infos), (other, *_, others) = (
            env.step(actions),
            mirror.step(symmetry.act(actions)),
        )
        yield (obs, infos), (other, others)


@pytest.fixture(scope="module")
def without_range_noise():
    """It is drawn beam by beam in the car's frame, and so is no mirror image of another's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sensors, "RANGE_NOISE", 0.0)
        yield


@pytest.fixture(
    scope="module",
    params=[
        {"track": "reinvent-like", "car": "sim4"},
        {"track": "oval", "car": "sim5", "sensors": "stereo"},
        {"track": "oval", "car": "ideal", "sensors": "camera+lidar", "n_bots": 6},
        {"track": "wide-loop", "sensors": "stereo+lidar", "n_bots": 4},
        {"track": "oval", "car": "sim5", "actions": RANGES},
    ],
    ids=["camera", "stereo", "camera+lidar", "stereo+lidar", "ranges"],
)
def steps(request, without_range_noise):
    symmetry = symmetry_of(**request.param)
    return symmetry, list(played(dict(request.param), symmetry))


def named(infos, name):
    return np.array([info[name] for _, info in infos])


def test_states_and_terms_on_the_mirrored_track_are_equal_to_the_bit(steps):
    _, both = steps
    one, other = zip(*both, strict=True)
    infos = one[0][1].keys()
    assert infos >= TERMS
    for name in infos - {"objects"}:
        sign = -1 if name in CHANGED else 1
        assert_array_equal(sign * named(one, name), named(other, name), err_msg=name)
    if "objects" in infos:
        assert_array_equal(named(one, "objects") * [1, -1, -1], named(other, "objects"))
    drove = named(one, "status")
    assert len(set(drove.ravel())) > 1, "no episode ended"
    for name in TERMS | (OBJECT_TERMS & infos):
        assert named(one, name).any(), f"{name} is always 0"


def cameras(obs):
    return obs["camera"] if isinstance(obs, dict) else obs


def differences(observe, both):
    """By how many grey levels each pixel differs from that in the mirror."""
    pairs = [(cameras(observe(obs)), cameras(other)) for (obs, _), (other, _) in both]
    return np.concatenate([np.abs(a.astype(np.int16) - b).ravel() for a, b in pairs])


def test_images_in_the_mirror_are_flipped(steps):
    symmetry, both = steps
    unlike = differences(symmetry.observe, both)
    assert unlike.max() <= 1  # texels are found in float32
    assert unlike.mean() < 0.0005
    assert (differences(lambda obs: obs, both) > 1).mean() > 0.1


def test_eyes_that_do_not_change_places_are_seen(steps):
    symmetry, both = steps
    if len(symmetry.channels) == 2:
        wrong = replace(symmetry, channels=(0, 1))
        assert (differences(wrong.observe, both) > 1).mean() > 0.02


def test_a_lidars_beams_are_reversed(steps):
    symmetry, both = steps
    if symmetry.beams is None:
        return
    ranges = np.array([symmetry.observe(obs)["lidar"] for (obs, _), _ in both])
    others = np.array([other["lidar"] for _, (other, _) in both])
    assert_allclose(ranges, others, rtol=0, atol=1e-6)  # float32
    assert (ranges < 1).any()
    wrong = np.array([obs["lidar"] for (obs, _), _ in both])
    assert np.abs(wrong - others).max() > 0.1


# -- actions


@pytest.mark.parametrize(
    ("actions", "order"),
    [
        (ACTIONS, (4, 3, 2, 1, 0, 9, 8, 7, 6, 5)),
        ([(20, 1), (0, 0.5), (-20, 1)], (2, 1, 0)),
        ([(20, 1), (20, 1), (-20, 1), (-20, 1)], (2, 3, 0, 1)),  # equal ones in their order
        ([(-0.0, 1)], (0,)),
    ],
)
def test_an_action_is_steered_the_other_way_in_the_mirror(actions, order):
    symmetry = symmetry_of(actions=actions)
    assert symmetry.actions.order == order
    assert symmetry.actions.is_involution
    assert_array_equal(symmetry.act(np.arange(len(order))), order)
    assert simulator(actions=actions).why_no_symmetry() is None


@pytest.mark.parametrize(
    ("actions", "which", "image"),
    [
        ([(20, 1), (0, 0.5)], "action 0, 20° at 1 m/s", "-20° at 1 m/s"),
        ([(0, 1), (-20, 1), (20, 0.5)], "action 1, -20° at 1 m/s", "20° at 1 m/s"),
        ([(20, 1), (-20, 1), (20, 1)], "action 2, 20° at 1 m/s", "-20° at 1 m/s"),
    ],
)
def test_without_a_mirror_image_of_each_action_there_is_no_symmetry(actions, which, image):
    racer = simulator(actions=actions)
    assert racer.symmetries() == ()
    assert racer.why_no_symmetry() == (
        f"expected a mirror image of each of env.actions; {which}, has none ({image})"
    )


@pytest.mark.parametrize("kind", sensors.SENSORS)
def test_the_symmetry_fits_what_the_sensors_read(kind):
    symmetry = symmetry_of(sensors=kind)
    space = RacerVectorEnv(load_track("oval"), 1, sensors=kind).single_observation_space
    camera = space["camera"] if kind.endswith("lidar") else space
    assert len(symmetry.channels) == camera.shape[-1]
    assert (symmetry.beams is not None) == kind.endswith("lidar")
    if symmetry.beams:
        assert len(symmetry.beams) == len(space["lidar"].low)
