"""Races within ranges of steering and speed: two numbers an action, as DeepRacer's PPO has them."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from small_runs import QUICK_LAP, add_teacher

from repaint_cli.envs.output import CountedPrints, output_to
from repaint_cli.envs.racer.actions import ActionRanges
from repaint_cli.envs.racer.deepracer.model_files import model_metadata, read_model_metadata
from repaint_cli.envs.racer.deepracer.reward_check import check_function
from repaint_cli.envs.racer.deepracer.simtrace_reader import read_episodes, read_training
from repaint_cli.envs.racer.dynamics.commands import commands_for
from repaint_cli.envs.racer.env import RacerVectorEnv
from repaint_cli.envs.racer.sight.noise import Noise
from repaint_cli.envs.racer.simulator import RacerSimulator
from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.errors import CardError, TeacherMismatch
from repaint_cli.policies.spaces import Spaces
from repaint_cli.tasks.card_files import read_task
from repaint_cli.tasks.card_text import to_toml
from repaint_cli.tasks.similarity import cosine

CASES = Path(__file__).parents[2] / "shared" / "data" / "deepracer" / "cases"
BENCHMARK = Path(__file__).parents[1] / "benchmarks" / "racing" / "ranges.toml"
RANGES = {"steering_angle": [-25, 25], "speed": [0.6, 1.8]}
SETTING = "env.actions={ steering_angle = [-25, 25], speed = [0.6, 1.8] }"
TASK = read_task("racer-inner").with_settings([SETTING])
CAR = Spaces((120, 160, 1), 2, False)
NET = QUICK_LAP[QUICK_LAP.index("net.conv=[[4,8,8]]") :: 2]


def traces_in(path):
    return [episode.trace for episode in read_episodes(path)]


def cars(n=1, actions=RANGES, **settings):
    return RacerVectorEnv(load_track("oval"), n, actions=actions, **settings)


def card(home, actions=RANGES, name="mine", base="racer-outer"):
    """A card within ranges, with a small network and a short training."""
    ranges = ", ".join(f"{key} = {value}" for key, value in actions.items())
    (home / f"{name}.toml").write_text(
        f'extends = "{base}"\nsummary = "Ranges."\n[env]\nactions = {{ {ranges} }}\n'
    )
    return f"{name}.toml"


def driver(home, name="driver", setting=SETTING, more=()):
    return add_teacher(home / "home" / "zoo", name, "racer-inner", CAR, [setting, *NET, *more])


# -- the environment


def test_minus_one_and_one_are_the_ends_of_the_ranges_and_params_say_what_was_chosen():
    env = cars(4, noise=Noise())
    assert env.single_action_space.shape == (2,)
    assert env.single_action_space.dtype == np.float32
    env.reset(seed=0)
    env.step(np.array([[-1, -1], [1, 1], [0, 0.5], [-7, 7]], np.float32))
    told = [(env.params(n)["steering_angle"], env.params(n)["speed"]) for n in range(4)]
    assert told == [(-25, 0.6), (25, 1.8), (0, 1.5), (-25, 1.8)]  # beyond the ends they are clipped


def test_the_ends_of_a_list_drive_as_those_of_ranges():
    listed, ranged = cars(2, [(-25, 0.6), (25, 1.8)]), cars(2)
    for env in (listed, ranged):
        env.reset(seed=3)
    for _ in range(10):
        one = listed.step(np.array([0, 1]))
        other = ranged.step(np.array([[-1, -1], [1, 1]], np.float32))
        assert_array_equal(one[0], other[0])
        assert_array_equal(one[4]["x"], other[4]["x"])


@pytest.mark.parametrize(
    ("actions", "line"),
    [
        (np.zeros(2, int), "expected 2 actions of two numbers, found shape \\(2,\\) of int"),
        (np.zeros((2, 3)), "found shape \\(2, 3\\) of float64"),
        (np.array([[0, np.nan], [0, 0]]), "expected finite numbers as actions, found"),
    ],
)
def test_wrong_actions_are_named(actions, line):
    env = cars(2)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=line):
        env.step(actions)


def test_wrong_ranges_are_named():
    with pytest.raises(ValueError, match=r"actions: speed: expected a range \[low, high\]"):
        cars(actions=RANGES | {"speed": [2, 1]})


# -- the card


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"speed": [1, 1]}, "env.actions.speed: expected a range [low, high] with low below high"),
        ({"steering_angle": [30, -30]}, "env.actions.steering_angle: expected a range [low, high]"),
        ({"speed": [0, 2]}, "env.actions.speed: expected speeds above 0 m/s, as the car only"),
        ({"speed": [-1, 2]}, "drives forwards, found [-1, 2]"),
        ({"speed": 2}, "env.actions.speed: expected a valid tuple, found 2"),
        ({"steering": [-3, 3]}, "unknown key 'env.actions.steering'"),
    ],
)
def test_ranges_that_are_none_are_refused_in_a_line(repaint, home, change, line):
    said = repaint("tasks", "check", card(home, RANGES | change))
    assert said.code == CardError.exit_code
    assert line in said.err
    assert said.err.count("\n") == 1


def test_ranges_beyond_the_car_are_a_warning_with_what_they_become(repaint, home):
    wide = {"steering_angle": [-45, 30], "speed": [0.05, 6]}
    said = repaint("tasks", "check", card(home, wide))
    assert (
        "warning: env.actions: the car steers by at most 30° and drives at 0.1 to 4 m/s: "
        "steering_angle from -45 to 30° becomes steering_angle from -30 to 30°, "
        "speed from 0.05 to 6 m/s becomes speed from 0.1 to 4 m/s"
    ) in said.out.splitlines()
    env = cars(1, wide)
    env.reset(seed=0)
    env.step(-np.ones((1, 2), np.float32))
    assert (env.params(0)["steering_angle"], env.params(0)["speed"]) == (-30, 0.1)
    assert TASK.env.doubts() == []


def test_a_card_is_written_and_read_as_it_is(home):
    (home / "copy.toml").write_text(to_toml(TASK))
    assert read_task("copy.toml").task == TASK.task
    assert TASK.task != read_task("racer-inner").task
    assert TASK.with_settings(["env.actions=[[0, 1]]"]).env.actions == ((0, 1),)


def test_the_time_limit_follows_from_the_slowest_speed():
    slow = TASK.with_settings(["env.actions={steering_angle = [-30, 30], speed = [0.1, 1]}"])
    a_lap = 15 * load_track(slow.env.track).length / 0.1
    assert slow.env.longest_episode() == pytest.approx(1.5 * a_lap, abs=1)


# -- DeepRacer's files


def ranges_file(folder, **data):
    space = {name: {"low": low, "high": high} for name, (low, high) in RANGES.items()}
    text = {"action_space": space, "sensor": ["FRONT_FACING_CAMERA"]}
    (folder / "m.json").write_text(json.dumps(text | {"action_space_type": "continuous"} | data))
    return folder / "m.json"


def test_a_continuous_action_space_is_read_and_written(tmp_path):
    read = read_model_metadata(ranges_file(tmp_path))
    assert read == {"actions": RANGES, "sensors": "camera"}
    env = RacerSimulator(simulator="racer", **read)
    written = model_metadata(env.actions, env.sensors, deep=False)
    assert written["action_space_type"] == "continuous"
    assert written["action_space"]["speed"] == {"high": 1.8, "low": 0.6}
    (tmp_path / "again.json").write_text(json.dumps(written))
    assert read_model_metadata(tmp_path / "again.json") == read


@pytest.mark.parametrize(
    ("data", "line"),
    [
        ({"training_algorithm": "sac"}, "expected training_algorithm clipped_ppo, found sac"),
        ({"action_space": {"speed": {"low": 1, "high": 4}}}, "expected low and high of steering"),
        ({"action_space": {"speed": 1, "steering_angle": 2}}, "expected low and high of steering"),
    ],
)
def test_what_is_no_space_of_ppo_is_refused(tmp_path, data, line):
    with pytest.raises(CardError, match=f"m.json: {line}"):
        read_model_metadata(ranges_file(tmp_path, **data))


@pytest.mark.skipif(not CASES.is_dir(), reason="the cases of DeepRacer users are not here")
def test_the_case_of_users_is_sound(repaint):
    said = repaint("tasks", "check", CASES / "ranges.toml")
    assert (said.code, said.err) == (0, "")
    assert "ranges is sound: 120×160×1 observations and 2 continuous actions" in said.out


REAL_ROWS = """episode,steps,X,Y,yaw,steer,throttle,action,reward,done,all_wheels_on_track,progress,closest_waypoint,track_len,tstamp,episode_status,pause_duration
0,1.0,3.2,0.7,0.2,-12.5,1.25,[-12.5    1.25],0.0,False,True,0.8,1,17.7,7.0,prepare,0.0
0,2.0,3.2,0.7,0.2,3.0,2.0,[3. 2.],1.0,True,True,0.8,1,17.7,7.1,off_track,0.0
"""  # noqa: E501 - as DeepRacer writes them


def test_logs_of_continuous_actions_are_read(tmp_path):
    (tmp_path / "0-iteration.csv").write_text(REAL_ROWS)
    (trace,) = traces_in(tmp_path / "0-iteration.csv")
    assert trace.action.tolist() == [-1, -1]
    assert trace.steer.tolist() == [-12.5, 3.0]


# -- reward functions and reward terms


def test_a_function_that_knows_round_speeds_only_is_found_out():
    source = (
        "SPEEDS = {round(0.1 * n, 1): n for n in range(40)}\n"
        "def reward_function(params):\n    return SPEEDS[round(params['speed'], 6)]\n"
    )
    halves = TASK.with_settings([SETTING.replace("[0.6, 1.8]", "[0.5, 2]")]).env
    errors = check_function(halves, "mine.py", source).errors
    assert all(error.place.startswith("mine.py:3: KeyError: ") for error in errors)
    assert errors
    plain = "def reward_function(params):\n    return params['speed']\n"
    (note,) = check_function(TASK.env, "mine.py", plain).notes
    assert note.startswith("mine.py pays 0.6 to 1.8 in ")


def test_examples_reach_both_ends():
    examples = commands_for(ActionRanges(**RANGES)).examples
    ends = np.deg2rad(25), np.array([0.6, 1.8])
    assert_allclose([examples[:, 0].min(), examples[:, 0].max()], [-ends[0], ends[0]])
    assert_allclose([examples[:, 1].min(), examples[:, 1].max()], ends[1])


# -- teachers and students


def test_a_lane_teacher_within_ranges_is_opposed_to_the_other_lane():
    other = read_task("racer-outer").with_settings([SETTING])
    assert cosine(TASK, other) == pytest.approx(-1)


@pytest.mark.parametrize(
    "method", ["scratch", "warm-start", "kickstart", "instance", "repaint", "repaint-joint", "auto"]
)
def test_every_method_transfers_within_ranges(repaint, home, unpainted, method):
    driver(home)
    words = [] if method == "auto" else ["--method", method]
    teacher = [] if method == "scratch" else ["--teacher", "driver"]
    ratio = ["--ratio", "1:1"] if method in ("instance", "repaint") else []
    run = ["--run", "run", *QUICK_LAP, *ratio]
    said = repaint("transfer", "--task", card(home), *teacher, *words, *run)
    assert said.code == 0, said.err
    with (home / "run" / "metrics.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    phases = {row["phase"] for row in rows}
    assert len(rows) == 2
    assert ("instance" in phases) == (method in ("instance", "repaint"))
    if method == "kickstart":
        assert all(np.isfinite(float(row["cross_entropy"])) for row in rows)


def test_a_teacher_of_a_list_does_not_fit_ranges_nor_one_of_ranges_a_list(repaint, home):
    driver(home)
    said = repaint("transfer", "--teacher", "racer-inner", "--task", card(home), *QUICK_LAP)
    assert said.code == TeacherMismatch.exit_code
    assert (
        "teacher 'racer-inner' has 120×160×1 observations and 10 discrete actions, task 'mine' has "
        "120×160×1 observations and 2 continuous actions; teachers that fit: driver"
    ) in said.err
    said = repaint("transfer", "--teacher", "driver", "--task", "racer-outer", *QUICK_LAP)
    assert "'driver' has 120×160×1 observations and 2 continuous actions, task 'racer" in said.err
    assert said.err.count("\n") == 1


def test_teachers_of_other_ranges_do_not_fit(repaint, home):
    driver(home, "slow", SETTING.replace("1.8", "1"))
    said = repaint("transfer", "--teacher", "slow", "--task", card(home), *QUICK_LAP)
    assert said.code == TeacherMismatch.exit_code
    assert (
        "teacher 'slow' and task 'mine' choose among other [env] actions: steering_angle from -25 "
        "to 25° and speed from 0.6 to 1 m/s, not steering_angle from -25 to 25° and speed from 0.6 "
        "to 1.8 m/s; teachers that fit: none yet"
    ) in said.err


def test_a_training_is_logged_evaluated_and_filmed(repaint, home, monkeypatch):
    said = repaint("train-teacher", "--task", card(home), "--run", "run", *QUICK_LAP)
    assert said.code == 0, said.err
    folder = home / "run" / "deepracer" / "seed-0"
    metadata = json.loads((folder / "model" / "model_metadata.json").read_text())
    assert metadata["action_space"]["steering_angle"] == {"high": 25.0, "low": -25.0}
    drives = [one.trace for _, episodes in read_training(folder) for one in episodes]
    steer = np.concatenate([trace.steer for trace in drives])
    assert len(np.unique(steer)) > 10
    assert np.abs(steer).max() <= 25
    assert all((trace.action == -1).all() for trace in drives)
    said = repaint("eval", "run", "--episodes", 2, "--noise", "none", "--render-offscreen",
                   "--simtrace", "logs")  # fmt: skip
    assert said.code == 0, said.err
    assert (home / "run" / "video.mp4").stat().st_size > 500
    (one, *_) = traces_in(home / "logs" / "training-simtrace" / "0-iteration.csv")
    assert 0.6 <= one.throttle.min() <= one.throttle.max() <= 1.8
    assert repaint("zoo", "verify", "mine", "--score").code == 0


@pytest.mark.filterwarnings("ignore")
def test_the_communitys_tools_load_it(repaint, home, monkeypatch, unpainted):
    logs = pytest.importorskip("deepracer.logs", reason="deepracer-utils is not installed")
    monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    said = repaint("transfer", "--method", "scratch", "--task", card(home), "--run", "run",
                   *QUICK_LAP)  # fmt: skip
    assert said.code == 0, said.err
    log = logs.DeepRacerLog(str(home / "run" / "deepracer" / "seed-0"))
    log.load()
    assert set(log.dataframe()["action"]) == {-1}
    assert log.action_space()["speed"] == {"high": 1.8, "low": 0.6}
    assert len(logs.AnalysisUtils.simulation_agg(log.dataframe())) == 6


@pytest.mark.slow
def test_a_small_network_learns_to_drive_laps(repaint, home):
    assert read_task(str(BENCHMARK)).env.doubts() == []
    said = repaint("train-teacher", "--task", BENCHMARK, "--seed", 100, "--iterations", 8,
                   "--run", "run")  # fmt: skip
    assert said.code == 0, said.err
    with (home / "run" / "metrics.csv").open(encoding="utf-8", newline="") as file:
        progress = [float(row["eval_progress"]) for row in csv.DictReader(file)]
    assert progress[0] < 40
    assert max(progress) > 80


# -- the mirror


def test_ranges_as_wide_to_both_sides_have_a_mirror_image():
    (symmetry,) = TASK.env.symmetries()
    assert symmetry.actions.order == (0, 1)
    assert symmetry.act(np.array([[0.5, 0.25]])).tolist() == [[-0.5, 0.25]]
    lopsided = TASK.with_settings([SETTING.replace("[-25, 25]", "[-25, 20]")]).env
    assert lopsided.symmetries() == ()
    assert lopsided.why_no_symmetry() == (
        "expected steering as far to the right as to the left in env.actions, found "
        "steering_angle from -25 to 20°"
    )


@pytest.mark.parametrize("view", ["mirrored", "both"])
def test_a_view_teaches(repaint, home, unpainted, view):
    same = ["reward.lane=0", "reward.keep=1"]  # in the mirror
    driver(home, more=same)
    sets = [word for setting in same for word in ("--set", setting)]
    words = ["--teacher", f"driver:{view}", "--method", "repaint", "--run", "run", *QUICK_LAP]
    said = repaint("transfer", "--task", card(home), *sets, *words)
    assert said.code == 0, said.err


def test_all_of_a_file_of_ranges_is_read(home):
    ranges_file(home, training_algorithm="clipped_ppo", version="5")
    (home / "mine.toml").write_text('extends = "racer-inner"\n[env]\nmodel_metadata = "m.json"\n')
    output = CountedPrints()
    with output_to(output):
        assert read_task("mine.toml").env.actions == ActionRanges(**RANGES)
    assert list(output.warnings) == []
