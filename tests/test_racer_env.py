import ast
from pathlib import Path

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from numpy.testing import assert_allclose, assert_array_equal

from repaint_cli.envs.racer.dynamics.car import FRONT_OFFSET, STEP_SECONDS
from repaint_cli.envs.racer.env import RacerVectorEnv
from repaint_cli.envs.racer.names import STATUS
from repaint_cli.envs.racer.sight.noise import Noise
from repaint_cli.envs.racer.track.track import Track

ROOT = Path(__file__).parents[1]
TERMS = {"lane", "keep", "dprog", "fail"}
STATES = {
    "x", "y", "heading", "speed", "steering", "progress", "lap_time", "wheels_on", "waypoint",
    "status",
}  # fmt: skip
STRAIGHT_ON, HARD_LEFT, HARD_RIGHT = 7, 9, 5
PARKS = {"autoreset_mode": AutoresetMode.DISABLED}


def load(name):
    return Track.from_waypoints(np.load(ROOT / "tasks" / "racer" / "tracks" / f"{name}.npy"), name)


@pytest.fixture(scope="module")
def track():
    return load("reinvent-like")


def mirrored(track):
    """The same road in a mirror: driven clockwise."""
    flip = np.array([-1.0, 1.0])
    rings = [ring * flip for ring in (track.centre, track.inner, track.outer)]
    return Track.from_waypoints(np.hstack(rings), "mirrored")


def played(env, seed, steps, options=None):
    """Everything an env says over some random steps, one array per kind."""
    images, infos = env.reset(seed=seed, options=options)
    outputs = [[images, *infos.values()]]
    for t in range(steps):
        actions = np.random.default_rng(t).integers(10, size=64)[: env.num_envs]
        images, rewards, terminations, truncations, infos = env.step(actions)
        outputs.append([images, *infos.values(), rewards, terminations, truncations])
    return outputs


def assert_same(first, second, rows=slice(None)):
    for step, other in zip(first, second, strict=True):
        for array, another in zip(step, other, strict=True):
            assert_array_equal(array, another[rows])


# -- the interface


def test_spaces_and_kinds(track):
    env = RacerVectorEnv(track, 3)
    images, infos = env.reset(seed=0)
    assert env.single_observation_space.shape == (120, 160, 1)
    assert env.observation_space.contains(images)
    assert env.action_space.contains(env.action_space.sample())
    assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert set(infos) == TERMS | STATES
    images, rewards, terminations, truncations, infos = env.step(np.array([0, 5, 9]))
    assert env.observation_space.contains(images)
    assert set(infos) == TERMS | STATES
    assert all(value.shape == (3,) and value.dtype == np.float64 for value in infos.values())
    assert rewards.dtype == np.float64
    assert terminations.dtype == truncations.dtype == np.bool_
    assert_array_equal(rewards, infos["dprog"])


def test_steps_share_no_memory(track):
    env = RacerVectorEnv(track, 2, **PARKS)
    first, infos = env.reset(seed=0)
    second, rewards, _, _, later = env.step(np.array([7, 7]))
    assert not np.shares_memory(first, second)
    assert not any(np.shares_memory(infos[key], later[key]) for key in infos)
    assert not np.shares_memory(rewards, later["dprog"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"num_envs": 0}, "expected num_envs of at least 1, found 0"),
        ({"max_steps": 0}, "expected max_steps of at least 1, found 0"),
        ({"threads": 0}, "expected threads of at least 1, found 0"),
        ({"car": "tank"}, "unknown car 'tank'; choose one of sim4, sim5, ideal"),
        ({"autoreset_mode": AutoresetMode.SAME_STEP}, "expected autoreset NEXT_STEP or DISABLED"),
    ],
)
def test_wrong_arguments_are_named(track, arguments, message):
    with pytest.raises(ValueError, match=message):
        RacerVectorEnv(track, **({"num_envs": 2} | arguments))


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (np.zeros(3, int), "expected 2 integer actions"),
        (np.zeros(2), "expected 2 integer actions"),
        (np.array([0, 10]), "expected actions from 0 to 9"),
        (np.array([-1, 0]), "expected actions from 0 to 9"),
    ],
)
def test_wrong_actions_are_named(track, actions, message):
    env = RacerVectorEnv(track, 2)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=message):
        env.step(actions)


def test_wrong_resets_are_named(track):
    env = RacerVectorEnv(track, 2)
    with pytest.raises(ResetNeeded):
        env.step(np.zeros(2, int))
    with pytest.raises(ValueError, match="expected 2 seeds, found 3"):
        env.reset(seed=[1, 2, 3])
    for wrong in (np.zeros(3), [np.nan, 0.0]):
        with pytest.raises(ValueError, match="expected 2 finite lap fractions"):
            env.reset(options={"lap_fraction": wrong})


@pytest.mark.parametrize("name", ["action", "brightness", "gaussian", "salt_pepper", "shift"])
def test_noise_has_bounds(name):
    with pytest.raises(ValueError, match=f"noise {name} must be in"):
        Noise(**{name: -1})


def test_kernels_use_nothing_of_another_file():
    """The compiler's cache would miss its change; numpy and the decorator itself are no matter."""
    for path in sorted((ROOT / "repaint_cli" / "envs" / "racer").glob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        imports = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
        foreign = {alias.name for node in imports for alias in node.names} - {"Any", "kernel"}
        for function in (node for node in tree.body if isinstance(node, ast.FunctionDef)):
            if any(getattr(mark, "id", "") == "kernel" for mark in function.decorator_list):
                used = {node.id for node in ast.walk(function) if isinstance(node, ast.Name)}
                assert not used & foreign, f"{path.name}: {function.name}"


# -- starts and determinism


def test_given_starts_are_kept_at_autoresets(track):
    env = RacerVectorEnv(track, 2, max_steps=3)
    _, first = env.reset(options={"lap_fraction": np.array([0.25, 1.5])})
    base = np.stack([first["x"], first["y"]], 1) - FRONT_OFFSET * np.stack(
        [np.cos(first["heading"]), np.sin(first["heading"])], 1
    )
    points, headings = track.pose_at(np.array([0.25, 0.5]))
    assert_allclose(base, points, atol=1e-12)
    assert_allclose(first["heading"], headings, atol=1e-12)
    outputs = [first] + [env.step(np.full(2, STRAIGHT_ON))[4] for _ in range(5)]
    for key in STATES:  # nothing of the first episode is left in the second
        assert_array_equal(outputs[4][key], outputs[0][key])
        assert_array_equal(outputs[5][key], outputs[1][key])


def test_starts_are_drawn_from_twenty_places(track):
    env = RacerVectorEnv(track, 200)
    _, infos = env.reset(seed=0)
    assert len(np.unique(np.round(infos["x"], 6))) == 20
    _, again = env.reset()
    assert (infos["x"] != again["x"]).mean() > 0.8
    _, same = env.reset(seed=0)
    assert_array_equal(infos["x"], same["x"])


@pytest.mark.parametrize("noise", [None, Noise()])
def test_a_car_does_not_notice_the_others_or_the_threads(track, noise):
    settings = {"noise": noise, "max_steps": 25}
    many = played(RacerVectorEnv(track, 5, **settings), [4, 5, 6, 7, 8], 40)
    threaded = RacerVectorEnv(track, 5, threads=3, **settings)
    assert_same(played(threaded, 4, 40), many)  # 4 stands for 4, 5, 6, …
    threaded.close()
    assert_same(played(RacerVectorEnv(track, 2, **settings), [4, 5], 40), many, slice(2))


def test_seeds_differ(track):
    first, second = (played(RacerVectorEnv(track, 1, noise=Noise()), seed, 3) for seed in (0, 1))
    assert not np.array_equal(first[-1][0], second[-1][0])


# -- the ends of episodes


def test_leaving_the_track_ends_the_episode_and_next_step_starts_another(track):
    env = RacerVectorEnv(track, 1)
    env.reset(seed=0)
    for _ in range(100):
        last_image, reward, terminated, truncated, infos = env.step(np.array([HARD_RIGHT]))
        if terminated[0]:
            break
    assert STATUS[int(infos["status"][0])] == "off_track"
    assert (infos["fail"][0], infos["lane"][0], infos["keep"][0]) == (1, 0, 0)
    assert not truncated[0]
    image, reward, terminated, truncated, infos = env.step(np.array([HARD_RIGHT]))
    assert (reward[0], terminated[0], truncated[0]) == (0, False, False)
    assert [infos[term][0] for term in TERMS] == [0] * 4
    assert infos["lap_time"][0] == infos["speed"][0] == infos["status"][0] == 0
    assert not np.array_equal(image, last_image)
    _, reward, _, _, infos = env.step(np.array([STRAIGHT_ON]))
    assert reward[0] > 0
    assert infos["lap_time"][0] == STEP_SECONDS


def test_a_parked_car_keeps_its_state_and_last_image(track):
    env = RacerVectorEnv(track, 2, noise=Noise(), **PARKS)
    env.reset(seed=0, options={"lap_fraction": np.zeros(2)})
    ends = 0
    for _ in range(100):
        image, _, terminated, _, infos = env.step(np.array([HARD_RIGHT, STRAIGHT_ON - 5]))
        ends += terminated[0]
        if terminated[0]:
            break
    for _ in range(3):
        kept = image[0].copy()
        image[0] = 0  # what was returned belongs to the caller
        image, reward, terminated, truncated, later = env.step(np.array([0, STRAIGHT_ON - 5]))
        assert_array_equal(image[0], kept)
        assert (reward[0], terminated[0], truncated[0]) == (0, False, False)
        assert [later[term][0] for term in TERMS] == [0] * 4
        assert all(later[key][0] == infos[key][0] for key in STATES)
        assert later["lap_time"][1] > infos["lap_time"][1]


def test_parked_cars_come_back_at_reset(track):
    env = RacerVectorEnv(track, 1, max_steps=1, **PARKS)
    env.reset(seed=0)
    assert env.step(np.array([STRAIGHT_ON]))[3][0]
    assert env.step(np.array([STRAIGHT_ON]))[4]["lap_time"][0] == STEP_SECONDS  # parked
    _, infos = env.reset(seed=0)
    assert infos["lap_time"][0] == 0
    assert env.step(np.array([STRAIGHT_ON]))[3][0]


def test_the_time_limit_truncates_and_does_not_terminate(track):
    env = RacerVectorEnv(track, 1, max_steps=5)
    env.reset(seed=0)
    flags = [env.step(np.array([2]))[2:4] for _ in range(5)]
    assert [bool(truncated[0]) for _, truncated in flags] == [False] * 4 + [True]
    assert not any(terminated[0] for terminated, _ in flags)


@pytest.mark.parametrize(("progress", "status"), [(99.9, "lap_complete"), (90.0, "off_track")])
def test_a_lap_that_ends_beside_the_road_is_a_lap(track, progress, status):
    env = RacerVectorEnv(track, 1, **PARKS)
    env.reset(options={"lap_fraction": [0.0]})
    fleet = env._fleet
    place, heading = track.pose_at(np.full(1, progress // 99 * 0.1 + 0.9))
    aside = 0.7 * track.width * np.array([-np.sin(heading[0]), np.cos(heading[0])])
    fleet.states[0, :2] = place[0] + aside
    fleet.progress[0] = progress
    _, _, terminated, truncated, infos = env.step(np.array([STRAIGHT_ON]))
    assert infos["wheels_on"][0] == 0
    assert (terminated[0], truncated[0]) == (True, False)
    assert STATUS[int(infos["status"][0])] == status
    assert infos["fail"][0] == (status == "off_track")
    assert env.params(0)["is_offtrack"]


def test_driving_backwards_ends_the_episode():
    """A car that turns round on a wide road loses progress until it is stopped for it."""
    corners = np.array([[0, 0], [20, 0], [20, 20], [0, 20], [0, 0]], dtype=float)
    grown = 2 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 1]])
    wide = Track.from_waypoints(np.hstack([corners, corners + grown, corners - grown]), "wide")
    env = RacerVectorEnv(wide, 1)
    _, infos = env.reset(options={"lap_fraction": np.array([0.125])})
    terminated = [False]
    while not terminated[0]:
        turned = abs(infos["heading"][0]) > 2.6
        action = np.array([STRAIGHT_ON if turned else HARD_LEFT])
        _, _, terminated, truncated, infos = env.step(action)
        assert not truncated[0]
    assert STATUS[int(infos["status"][0])] == "reversed"


# -- the terms


@pytest.mark.parametrize("mirror", [False, True])
def test_lane_is_the_side_of_the_infield_whichever_way_the_track_runs(track, mirror):
    road = mirrored(track) if mirror else track
    assert road.ccw != mirror
    env = RacerVectorEnv(road, 20)
    inwards, outwards = (HARD_RIGHT, HARD_LEFT) if mirror else (HARD_LEFT, HARD_RIGHT)
    for action, lane in ((inwards, 1), (outwards, -1)):
        env.reset(options={"lap_fraction": np.linspace(0.01, 0.08, 20)})
        for _ in range(6):
            _, _, _, _, infos = env.step(np.full(20, action))
        assert_array_equal(infos["lane"], np.full(20, lane))


def test_the_gains_add_up_to_the_progress(track):
    env = RacerVectorEnv(track, 4, max_steps=100, **PARKS)
    _, infos = env.reset(seed=1)
    start, total = infos["progress"], np.zeros(4)
    for _ in range(60):
        _, rewards, _, _, infos = env.step(np.array([2, 7, 8, 6]))
        total += rewards
    assert_allclose(100 * total, infos["progress"] - start, atol=1e-9)


# -- noise


def test_noise_is_small_and_there(track):
    quiet, noisy = (RacerVectorEnv(track, 8, noise=noise) for noise in (None, Noise()))
    start = {"lap_fraction": np.linspace(0, 1, 8, endpoint=False)}
    clean, _ = quiet.reset(seed=0, options=start)
    image, _ = noisy.reset(seed=0, options=start)
    inner = np.abs(image.astype(int) - clean)[:, 1:-1, 1:-1]
    assert 1 < np.median(inner) < 12
    spots = ((image == 0) | (image == 255)).mean()
    assert 0.0003 < spots < 0.003
    steers = []
    for _ in range(15):
        _, _, _, _, infos = noisy.step(np.full(8, 8))
        steers.append(infos["steering"])
    assert np.ptp(steers[-1]) > 0.001
    assert_allclose(steers[-1], np.mean(steers[-1]), rtol=0.1)


def test_zero_noise_is_none(track):
    nothing = Noise(action=0, brightness=0, gaussian=0, salt_pepper=0, shift=0)
    start = {"lap_fraction": np.array([0.1, 0.6])}
    with_zero, without = (
        played(RacerVectorEnv(track, 2, noise=noise, max_steps=30), 0, 20, start)
        for noise in (nothing, None)
    )
    assert_same(with_zero, without)


def test_the_other_way_progress_grows_and_lanes_stay_where_they_are(track):
    env = RacerVectorEnv(track, 2)
    places = [0.25, 0.75]  # the same point of the road
    env.reset(seed=1, options={"lap_fraction": places, "reverse": [False, True]})
    assert_allclose(env._fleet.states[0, :2], env._fleet.states[1, :2], atol=1e-6)
    for _ in range(12):
        *_, info = env.step(np.full(2, 2))
    assert (info["progress"] > 0).all()
    assert (info["dprog"] > 0).all()
    apart = info["heading"][0] - info["heading"][1]
    assert np.cos(apart) < -0.7
    inner = [
        np.hypot(*(track.inner - [x, y]).T).min() < np.hypot(*(track.outer - [x, y]).T).min()
        for x, y in zip(info["x"], info["y"], strict=True)
    ]
    assert_array_equal(info["lane"], np.where(inner, 1, -1))
