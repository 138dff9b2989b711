"""Logs in DeepRacer's layout: what stands in them, and that its community's tools read them."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from small_runs import QUICK_LAP, log_of

from repaint_cli.envs.episodes import Steps
from repaint_cli.envs.racer.deepracer.model_files import read_hyperparameters, read_model_metadata
from repaint_cli.envs.racer.deepracer.simtrace import COLUMNS
from repaint_cli.envs.racer.deepracer.simtrace_reader import read_episodes, read_training
from repaint_cli.envs.racer.deepracer.traces import Trace, traces_of
from repaint_cli.envs.racer.names import STATUS
from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.errors import StoreError
from repaint_cli.tasks.card_files import read_task
from repaint_cli.tasks.task import RewardCode

REAL = Path(__file__).parents[2] / "shared" / "data" / "deepracer" / "logs"
ALONE = ("training-simtrace/0-iteration.csv", "metrics/TrainingMetrics.json")
TEXT = "logs/training/training-repaint-robomaker.log"
TASK = read_task("racer-inner")


def traces_in(path):
    return [episode.trace for episode in read_episodes(path)]


def trace(n_steps=3, status="off_track", seed=0):
    """An episode of anything, with no more digits than a log has."""
    rng = np.random.default_rng(seed)

    def numbers(digits):
        return rng.normal(size=n_steps).round(digits)

    return Trace(
        x=numbers(4), y=numbers(4), yaw=numbers(4), steer=numbers(2), throttle=numbers(2),
        action=rng.integers(10, size=n_steps), reward=numbers(3),
        all_wheels_on_track=rng.random(n_steps) < 0.5, progress=np.sort(numbers(4)),
        closest_waypoint=rng.integers(99, size=n_steps), crashes=np.arange(n_steps) // 2,
        status=status,
    )  # fmt: skip


def rows_of(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def metrics_of(folder):
    return json.loads((folder / ALONE[1]).read_text(encoding="utf-8"))["metrics"]


def test_what_is_written_is_read_again(tmp_path):
    written = [trace(3, "lap_complete"), trace(1, "crashed", seed=1), trace(5, "time_up", seed=2)]
    log_of(tmp_path, TASK).train(1, written)
    ((k, read),) = read_training(tmp_path)
    assert k == 1
    for ours, episode in zip(written, read, strict=True):
        theirs = episode.trace
        assert theirs.status == ours.status
        for name in vars(ours):
            assert_array_equal(getattr(theirs, name), getattr(ours, name), err_msg=name)


def test_rows_are_deepracers(tmp_path):
    log_of(tmp_path, TASK).train(1, [trace(3, "lap_complete"), trace(2, "in_progress")])
    rows = rows_of(tmp_path / ALONE[0])
    assert tuple(rows[0]) == COLUMNS
    assert [(row["episode"], row["steps"]) for row in rows] == [
        ("0", "1.0"), ("0", "2.0"), ("0", "3.0"), ("1", "1.0"), ("1", "2.0")
    ]  # fmt: skip
    recorded = [(row["episode_status"], row["done"]) for row in rows]
    assert recorded == [
        ("prepare", "False"), ("in_progress", "False"), ("lap_complete", "True"),
        ("prepare", "False"), ("in_progress", "False"),
    ]  # fmt: skip
    assert_allclose([float(row["tstamp"]) for row in rows], np.arange(5) / 15, atol=1e-4)
    assert {row["track_len"] for row in rows} == {"17.7000"}


def test_all_steps_of_a_training_stand_in_one_text(tmp_path):
    log = log_of(tmp_path, TASK.with_settings(["ppo.n_episodes=2"]))
    log.train(1, [trace(3, "lap_complete"), trace(2)])
    log.evaluate(1, [trace(4)])
    log.train(2, [trace(2, "crashed")])
    lines = (tmp_path / TEXT).read_text().splitlines()
    whole = (
        r"SIM_TRACE_LOG:\d+,\d+(,-?\d+\.\d{4}){3}(,-?\d+\.\d{2}){2},\d,-?\d+\.\d{4}(,(True|False)){2},"
        r"-?\d+\.\d{4},\d+,17\.70,\d+\.\d{4},[a-z_]+,0\.00,\d,\d{10}\.\d{4}"
    )
    assert all(re.fullmatch(whole, line) for line in lines)
    assert [line[14:].split(",")[0] for line in lines] == list("0001122")
    files = [tmp_path / "training-simtrace" / f"{k}-iteration.csv" for k in (0, 1)]
    rows = [row for file in files for row in rows_of(file)]
    for line, row in zip(lines, rows, strict=True):
        for text, cell in zip(line[14:].split(","), row.values(), strict=True):
            assert text == cell or float(text) == pytest.approx(float(cell), abs=6e-5)


def test_a_text_goes_back_with_its_run(tmp_path):
    log = log_of(tmp_path, TASK)
    log.train(1, [trace(3)])
    position, text = log.position, (tmp_path / TEXT).read_text()
    log.train(2, [trace(2)])
    again = log_of(tmp_path, TASK, resumed=True)
    again.go_back(1, position)
    assert (tmp_path / TEXT).read_text() == text
    again.train(2, [trace(4)])
    assert len((tmp_path / TEXT).read_text().splitlines()) == 7
    (tmp_path / TEXT).unlink()  # which is the user's right
    again.go_back(1, position)
    again.train(2, [trace(4)])
    assert len((tmp_path / TEXT).read_text().splitlines()) == 4
    again.go_back(0, {})
    assert not (tmp_path / TEXT).exists()


@pytest.mark.filterwarnings("ignore")
def test_the_communitys_tools_read_the_text(tmp_path):
    logs = pytest.importorskip("deepracer.logs", reason="deepracer-utils is not installed")
    written = [trace(3, "lap_complete"), trace(2, seed=1), trace(4, seed=2)]
    log = log_of(tmp_path, TASK.with_settings(["ppo.n_episodes=2"]))
    log.train(1, written[:2])
    log.train(2, written[2:])
    frame = logs.SimulationLogsIO.load_pandas(str(tmp_path / TEXT), 2)
    assert frame["iteration"].tolist() == [0] * 5 + [1] * 4
    assert frame["episode"].tolist() == [0] * 3 + [1] * 2 + [2] * 4
    assert frame["episode_status"].tolist()[2] == "lap_complete"
    for column, name in (
        ("x", "x"), ("yaw", "yaw"), ("steering_angle", "steer"), ("speed", "throttle"),
        ("reward", "reward"), ("progress", "progress"), ("closest_waypoint", "closest_waypoint"),
        ("on_track", "all_wheels_on_track"),
    ):  # fmt: skip
        ours = np.concatenate([getattr(one, name) for one in written])
        assert_allclose(frame[column].astype(float), ours, err_msg=name)
    assert frame["done"].sum() == 3


def test_episodes_count_on_also_over_the_teachers_iterations(tmp_path):
    log = log_of(tmp_path, TASK.with_settings(["ppo.n_episodes=2"]))
    log.train(1, [trace(), trace()])
    log.evaluate(1, [trace(4, "lap_complete")])
    log.evaluate(2, [trace()])  # after an instance iteration
    log.train(3, [trace(), trace()])
    assert [k for k, _ in read_training(tmp_path)] == [1, 3]
    third = rows_of(tmp_path / "training-simtrace" / "2-iteration.csv")
    assert sorted({row["episode"] for row in third}) == ["4", "5"]
    recorded = [(item["episode"], item["trial"], item["phase"]) for item in metrics_of(tmp_path)]
    assert recorded == [
        (1, 1, "training"), (2, 2, "training"), (2, 2, "evaluation"), (4, 2, "evaluation"),
        (5, 1, "training"), (6, 2, "training"),
    ]  # fmt: skip
    assert metrics_of(tmp_path)[2]["episode_status"] == "Lap complete"
    assert metrics_of(tmp_path)[2]["elapsed_time_in_milliseconds"] == round(4000 / 15)
    starts = [item["start_time"] for item in metrics_of(tmp_path)]
    ends = [item["metric_time"] for item in metrics_of(tmp_path)]
    assert starts[1:] == ends[:-1]  # one after the other


def test_an_evaluation_beside_a_training_leaves_its_log_alone(tmp_path):
    log_of(tmp_path, TASK).train(1, [trace()])
    before = [(tmp_path / place).read_text() for place in ALONE]
    files = log_of(tmp_path, TASK).evaluate_alone("20261231235959", [trace(2)])
    own, text = files
    assert text.name == "evaluation-20261231235959-repaint-robomaker.log"
    assert len(text.read_text().splitlines()) == 2
    assert own == tmp_path / "evaluation-20261231235959" / "evaluation-simtrace" / "0-iteration.csv"
    assert [(tmp_path / place).read_text() for place in ALONE] == before
    assert len(rows_of(own)) == 2


def test_logs_of_other_settings_are_left_alone(tmp_path):
    log_of(tmp_path, TASK).train(1, [trace()])
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    code = {"name": "r.py", "source": "def reward_function(params):\n    return 1"}
    others = [
        TASK.with_settings(["ppo.learning_rate=1e-5"]),
        TASK.with_settings(['env.sensors="stereo"']),
        TASK.model_copy(update={"reward_code": RewardCode(**code)}),
    ]
    for other, what in zip(others, ("hyperparameters", "model_metadata", "reward_f"), strict=True):
        with pytest.raises(StoreError, match=f"holds logs of other settings: its .*{what}"):
            log_of(tmp_path, other)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_every_column_of_a_trace_is_the_cars():
    """Two cars of one seed; the first touches a bot twice, the second drives the other way."""
    names = read_task("racer-avoid").env.records
    records = {name: np.zeros((5, 1, 2)) for name in names if name != "objects"}
    records["heading"][:, 0, 0] = np.pi / 2
    records["wheels_on"][:, 0, 0] = [4, 4, 3, 4, 0]
    records["hit"][:, 0, 0] = [0, 1, 1, 0, 1]
    records["progress"][:, 0, 0] = np.arange(5)
    records["waypoint"][:, 0, 0] = 7
    records["status"][4, 0, 0] = STATUS.index("crashed")

    steps = Steps(
        actions=np.full((5, 1, 2), 8), rewards=np.ones((5, 1, 2)),
        valid=np.ones((5, 1, 2), bool), ends=np.zeros((5, 1, 2), bool), records=records,
    )  # fmt: skip
    first, second = traces_of(steps, TASK.env.actions, 0)
    assert_allclose(first.yaw, 90)
    assert first.all_wheels_on_track.tolist() == [True, True, False, True, False]
    assert first.crashes.tolist() == [0, 1, 1, 1, 2]
    assert first.progress.tolist() == [0, 1, 2, 3, 4]
    assert first.closest_waypoint.tolist() == [7] * 5
    assert (first.status, second.status) == ("crashed", "in_progress")
    assert_allclose(first.steer, 15)
    assert first.throttle.tolist() == [1.0] * 5


def test_the_other_way_the_waypoints_are_counted_the_other_way(repaint, home):
    said = repaint(
        "eval", "racer-inner", "--simtrace", "mine", "--episodes", 2, "--noise", "none",
        "--set", "eval.both_directions=true",
    )  # fmt: skip
    assert said.code == 0
    there, back = traces_in(home / "mine" / ALONE[0])
    track = load_track(TASK.env.track)
    for drive, road in ((there, track), (back, track.reversed())):
        gaps = np.hypot(*(road.centre[drive.closest_waypoint] - drive.xy).T)
        assert gaps.max() < 0.5
        assert (np.diff(drive.closest_waypoint) >= 0).mean() > 0.95


def test_settings_come_back_from_the_files_beside_the_log(tmp_path):
    task = TASK.with_settings(['env.sensors="stereo+lidar"', "ppo.learning_rate=1e-4"])
    log_of(tmp_path, task)
    settings = read_model_metadata(tmp_path / "model" / "model_metadata.json")
    assert settings["sensors"] == "stereo+lidar"
    assert tuple(map(tuple, settings["actions"])) == task.env.actions
    ppo = read_hyperparameters(tmp_path / "ip" / "hyperparameters.json")
    assert all(getattr(task.ppo, name) == value for name, value in ppo.items())


@pytest.mark.skipif(not REAL.is_dir(), reason="the DeepRacer logs are not here")
def test_real_logs_are_read():
    drives = traces_in(REAL / "drfc1-training-12-iteration.csv")
    assert len(drives) == 20
    assert {drive.status for drive in drives} == {"off_track"}
    assert sum(map(len, drives)) == 1373
    assert drives[0].x[0] == 3.199954121958313


def test_episodes_of_a_rollout_are_cut_where_they_end():
    steps = Steps(
        actions=np.zeros((5, 1, 2), int),
        rewards=np.arange(10.0).reshape(5, 1, 2),
        valid=np.array([[1, 1], [1, 1], [0, 1], [1, 0], [1, 0]], bool)[:, None],
        ends=np.array([[0, 0], [1, 0], [0, 1], [0, 0], [0, 0]], bool)[:, None],
        records={name: np.zeros((5, 1, 2)) for name in TASK.env.records},
    )
    found = traces_of(steps, TASK.env.actions, 0)
    assert [episode.reward.tolist() for episode in found] == [[0, 2], [6, 8], [1, 3, 5]]
    assert_allclose(found[0].steer, [-30, -30])
    assert found[0].throttle.tolist() == [0.5, 0.5]


@pytest.mark.filterwarnings("ignore")
def test_the_communitys_tools_load_a_training_and_an_evaluation(repaint, home, monkeypatch):
    logs = pytest.importorskip("deepracer.logs", reason="deepracer-utils is not installed")
    monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    said = repaint(
        "transfer", "--method", "scratch", "--task", "racer-inner", "--run", "run", *QUICK_LAP
    )
    assert said.code == 0
    assert "wrote run/deepracer/: seed-0" in said.out
    folder = home / "run" / "deepracer" / "seed-0"
    log = logs.DeepRacerLog(str(folder))
    log.load()
    frame = log.dataframe()
    assert sorted(frame["unique_episode"].unique()) == list(range(6))
    table = logs.AnalysisUtils.simulation_agg(frame)
    assert len(table) == 6
    assert log.hyperparameters()["num_episodes_between_training"] == 3
    assert len(log.action_space()) == 10
    metrics = logs.TrainingMetrics(None, fname=str(folder / ALONE[1])).metrics
    assert (metrics["phase"] == "evaluation").sum() == 4
    assert sorted(metrics["iteration"].unique()) == [0, 1]

    repaint("eval", "run", "--simtrace", "mine", "--episodes", 3)  # written over by the next
    said = repaint("eval", "run", "--simtrace", "mine")
    assert said.code == 0
    assert "wrote mine/metrics/: TrainingMetrics.json" in said.out
    log = logs.DeepRacerLog(str(home / "mine"))
    log.load()
    table = logs.AnalysisUtils.simulation_agg(log.dataframe())
    recorded = json.loads((home / "run" / "eval.json").read_text())
    assert_allclose(table["reward"], recorded["returns"][0])
    assert_allclose(table["progress"], recorded["progress"][0], atol=1e-4)
    assert_array_equal(table["steps"], recorded["lengths"][0])
    repaint("eval", "run", "--simtrace", "alone")
    log = logs.DeepRacerLog(str(home / "alone"))
    log.load_evaluation_trace()
    assert len(log.dataframe()) == sum(recorded["lengths"][0])


def test_only_races_have_such_logs(repaint):
    said = repaint("eval", "reacher", "--simtrace", "mine")
    assert said.code == 3
    assert "expected --simtrace with a racing task, found 'reacher'; leave it out" in said.err
