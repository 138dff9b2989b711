import ast
import csv
from pathlib import Path

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from numpy.testing import assert_allclose, assert_array_equal

from repaint_cli.envs.racer import STATUS, Noise, RacerVectorEnv, Track, reference, rules
from repaint_cli.envs.racer.car import (
    ACTIONS,
    BODY,
    CAR_PROFILES,
    FRONT_OFFSET,
    STEP_SECONDS,
    drive_rows,
)
from repaint_cli.envs.racer.geometry import (
    CENTRE_GAP,
    INNER_GAP,
    NDIST,
    OUTER_GAP,
    WHEELS_ON,
    measure,
)

ROOT = Path(__file__).parents[1]
REAL = ROOT.parent / "shared" / "data" / "deepracer"
TERMS = {"lane", "keep", "dprog", "fail"}
STATES = {"x", "y", "heading", "speed", "steering", "progress", "lap_time", "status"}
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
    told = [[images, *infos.values()]]
    for t in range(steps):
        actions = np.random.default_rng(t).integers(10, size=64)[: env.num_envs]
        images, rewards, terminations, truncations, infos = env.step(actions)
        told.append([images, *infos.values(), rewards, terminations, truncations])
    return told


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
    for _ in range(4):
        _, _, _, _, infos = env.step(np.full(2, STRAIGHT_ON))
    for key in STATES:
        assert_array_equal(infos[key], first[key])


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
    while True:
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
    while True:
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
    assert env.step(np.array([7]))[3][0]
    env.reset(seed=0)
    assert env.step(np.array([7]))[4]["dprog"][0] > 0 or env.step(np.array([7]))[3][0]


def test_the_time_limit_truncates_and_does_not_terminate(track):
    env = RacerVectorEnv(track, 1, max_steps=5)
    env.reset(seed=0)
    flags = [env.step(np.array([2]))[2:4] for _ in range(5)]
    assert [bool(truncated[0]) for _, truncated in flags] == [False] * 4 + [True]
    assert not any(terminated[0] for terminated, _ in flags)


def judged(wheels=4, progress=50.0, steps=1, still=0, backwards=0):
    measures = np.zeros((1, 6))
    measures[0, WHEELS_ON] = wheels
    counters = rules.Counters(*(np.array([n]) for n in (steps, still, backwards)))
    return STATUS[rules.status_of(measures, np.array([progress]), counters, 100)[0]]


@pytest.mark.parametrize(
    ("facts", "status"),
    [
        ({}, "in_progress"),
        ({"wheels": 1}, "in_progress"),
        ({"wheels": 0}, "off_track"),
        ({"wheels": 0, "progress": 100.0, "steps": 100}, "off_track"),
        ({"progress": 100.0, "steps": 100}, "lap_complete"),
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
    counters = rules.Counters.zeros(3)
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
    answer = rules.progress_since(*(np.array([value]) for value in (ndist, start, previous)))
    assert_allclose(answer, progress, atol=1e-9)


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
        _, _, terminated, _, infos = env.step(action)
    assert STATUS[int(infos["status"][0])] == "reversed"


# -- the terms


@pytest.mark.parametrize("mirror", [False, True])
def test_lane_is_the_side_of_the_infield_whichever_way_the_track_runs(track, mirror):
    road = mirrored(track) if mirror else track
    assert road.ccw != mirror
    env = RacerVectorEnv(road, 20)
    env.reset(options={"lap_fraction": np.arange(20) / 20})
    steer = np.array([5, 9] if mirror else [9, 5])  # towards the infield, away from it
    for action, sign in zip(steer, (1, -1), strict=True):
        env.reset(options={"lap_fraction": np.full(20, 0.05)})
        for _ in range(6):
            _, _, _, _, infos = env.step(np.full(20, action))
        assert_array_equal(infos["lane"], np.full(20, sign))


def test_keep_needs_all_wheels_and_room():
    def keep(wheels, gap):
        measures = np.zeros((1, 6))
        measures[0, [WHEELS_ON, CENTRE_GAP, 4]] = wheels, gap, 0.8
        return rules.reward_terms(measures, np.zeros(1), np.zeros(1, int))["keep"][0]

    assert [keep(4, 0.0), keep(4, 0.34), keep(4, 0.36), keep(3, 0.0)] == [1, 1, 0, 0]


def test_the_gains_add_up_to_the_progress(track):
    env = RacerVectorEnv(track, 4, max_steps=100, **PARKS)
    _, infos = env.reset(seed=1)
    start, total = infos["progress"], np.zeros(4)
    for _ in range(60):
        _, rewards, _, _, infos = env.step(np.array([2, 7, 8, 6]))
        total += rewards
    assert_allclose(100 * total, infos["progress"] - start, atol=1e-9)


def test_where_a_car_stands_agrees_with_the_reference(track):
    rng = np.random.default_rng(0)
    for road in (track, mirrored(track)):
        low, high = road.outer.min(axis=0), road.outer.max(axis=0)
        states = np.zeros((400, 5))
        states[:, :2] = rng.uniform(low, high, size=(400, 2))
        states[:200, :2] = road.pose_at(rng.random(200))[0] + rng.normal(0, 0.3, (200, 2))
        states[:, 2] = rng.uniform(-np.pi, np.pi, 400)
        fronts, measures = np.zeros((400, 2)), np.zeros((400, 6))
        rings = (road.centre, road.distances, road.inner, road.outer)
        measure(np.arange(400), states, BODY, *rings, fronts, measures)
        assert_allclose(measures, reference.locate(road, states), rtol=0, atol=1e-9)


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


# -- the task can be solved, and the world is DeepRacer's


class Planner:
    """Looks eight steps ahead with each action held, and takes the best for a lane."""

    def __init__(self, track, lane):
        self.track, self.lane = track, lane
        self.car = CAR_PROFILES["sim4"].constants()
        self.before = np.zeros(2)

    def __call__(self, infos):
        x, y, yaw, speed, steering = (
            infos[key][0] for key in ("x", "y", "heading", "speed", "steering")
        )
        base = x - FRONT_OFFSET * np.cos(yaw), y - FRONT_OFFSET * np.sin(yaw)
        states = np.tile([*base, yaw, speed, steering], (10, 1))
        before, rows = np.tile(self.before, (10, 1)), np.arange(10)
        fronts, measures, scores = np.zeros((10, 2)), np.zeros((10, 6)), np.zeros(10)
        track = self.track
        rings = (track.centre, track.distances, track.inner, track.outer)
        measure(rows, states, BODY, *rings, fronts, measures)
        ndist = measures[:, NDIST].copy()
        for _ in range(8):
            drive_rows(rows, states, before, ACTIONS, self.car, STEP_SECONDS)
            before = ACTIONS
            measure(rows, states, BODY, *rings, fronts, measures)
            lead = self.lane * (measures[:, OUTER_GAP] - measures[:, INNER_GAP])
            scores += (lead > 0.03) - 5.0 * (measures[:, CENTRE_GAP] > 0.28)
        scores += 100 * ((measures[:, NDIST] - ndist + 0.5) % 1 - 0.5)
        best = int(scores.argmax())
        self.before = ACTIONS[best]
        return np.array([best])


@pytest.mark.parametrize("lane", [1, -1])
def test_the_default_track_can_be_lapped_in_either_lane(track, lane):
    env = RacerVectorEnv(track, 1)
    _, infos = env.reset(options={"lap_fraction": np.zeros(1)})
    planner, terminated, lanes = Planner(track, lane), [False], []
    while not terminated[0]:
        _, _, terminated, truncated, infos = env.step(planner(infos))
        lanes.append(infos["lane"][0])
        assert not truncated[0]
    assert STATUS[int(infos["status"][0])] == "lap_complete"
    assert infos["progress"][0] == 100
    assert len(lanes) < 360
    assert np.mean(np.array(lanes) == lane) > 0.95


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
        ours = rules.progress_since(
            *(np.array([value]) for value in (measured[NDIST], start, previous))
        )[0]
        wrong += abs(ours - percent) > 1e-3
        previous = ours if ours < 100 else 0.0  # an evaluation drives lap after lap
    assert wrong == 0
    all_on = np.array([row["all_wheels_on_track"] == "True" for row in rows])
    assert np.mean((measures[:, WHEELS_ON] == 4) == all_on) >= 0.9997
    off = np.array([row["episode_status"] == "off_track" for row in rows])
    assert np.mean((measures[:, WHEELS_ON] == 0) == off) >= 0.999
