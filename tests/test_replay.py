"""Logged laps, paid by another reward: `repaint tasks replay`."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from small_runs import log_of

from repaint_cli.envs.episodes import Steps
from repaint_cli.envs.logs import Replay, ReplayedEpisode
from repaint_cli.envs.racer.deepracer.driven import read_driven
from repaint_cli.envs.racer.deepracer.log_files import find_logs
from repaint_cli.envs.racer.deepracer.simtrace_reader import read_episodes
from repaint_cli.envs.racer.deepracer.simtrace_text import COLUMNS, text_line
from repaint_cli.envs.racer.deepracer.traces import Trace, traces_of
from repaint_cli.envs.racer.dynamics.fleet import Fleet
from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.errors import CardError, CheckpointError, NotFound, StoreError, UsageError
from repaint_cli.files.paths import shipped
from repaint_cli.report.replay import correlation, correlation_text, plot_replay
from repaint_cli.tasks.card_files import read_task

REAL = Path(__file__).parents[2] / "shared" / "data" / "deepracer"
NEEDS_REAL = pytest.mark.skipif(not REAL.is_dir(), reason="the DeepRacer logs are not here")
TRAINING, EVALUATION = (
    REAL / "logs" / f"drfc1-{kind}-iteration.csv" for kind in ("training-12", "evaluation-0")
)
OVAL = shipped("tasks") / "racer" / "tracks" / "oval.npy"
CENTRE = """def reward_function(params):
    share = params["distance_from_center"] / params["track_width"]
    return 1.0 if share <= 0.1 else 0.5 if share <= 0.25 else 0.1 if share <= 0.5 else 1e-3
"""
ALL_KEYS = """
steps = 0


def reward_function(params):
    global steps
    steps = 1 if params["steps"] == 1 else steps + 1
    assert steps == params["steps"]
    numbers = (
        "all_wheels_on_track", "x", "y", "distance_from_center", "projection_distance", "progress",
        "steps", "speed", "track_width", "track_length", "is_left_of_center", "is_reversed",
        "is_offtrack", "is_crashed", "sim_time",
    )
    paid = sum(float(params[name]) * (k + 1) for k, name in enumerate(numbers))
    paid += params["heading"] / 50 + params["steering_angle"] / 7 + len(params["waypoints"])
    return paid + 0.3 * params["closest_waypoints"][0] + 0.1 * params["closest_waypoints"][1]
"""


def card(home, source="", track="oval", name="mine", reward="", env=""):
    """A card with a reward function, or with weights."""
    if source:
        (home / f"{name}.py").write_text(source)
        reward = f'function = "{name}.py"\n{reward}'
    (home / f"{name}.toml").write_text(
        f'extends = "racer-inner"\nsummary = "Mine."\n[env]\ntrack = "{track}"\n{env}\n'
        f"[reward]\n{reward}"
    )
    return f"{name}.toml"


def drive(task, folder, n_steps=40, reverse=False):
    """Log two cars that drive a while, each in a way of its own; return what they were paid."""
    env = task.make_env(2, one_episode=True)
    env.reset(seed=[0, 1], options={"lap_fraction": [0.9, 0.3], "reverse": [reverse, False]})
    rng, told = np.random.default_rng(0), []
    for _ in range(n_steps):
        actions = np.where(rng.random(2) < 0.8, 7, rng.integers(10, size=2))
        before = told[-1][4]["status"] if told else np.zeros(2)
        _, rewards, over, cut, info = env.step(actions)
        told.append((actions, rewards, before == 0, over | cut, info))
    env.close()
    actions, rewards, valid, ends, infos = zip(*told, strict=True)
    records = {name: np.stack([info[name] for info in infos])[:, None] for name in task.env.records}
    parts = (np.stack(part)[:, None] for part in (actions, rewards, valid, ends))
    traces = traces_of(
        Steps(*parts, records=records), task.env.actions, 0, scale=task.logged.scale
    )  # fmt: skip
    log_of(folder, task).train(1, traces)
    return [trace.reward for trace in traces]


def replayed(task, *logs):
    code = task.reward_code and (task.reward_code.name, task.reward_code.source)
    return task.env.logs.replay([Path(log) for log in logs], task.reward, code)


@NEEDS_REAL
@pytest.mark.parametrize(("log", "episodes", "steps"), [(TRAINING, 20, 1353), (EVALUATION, 3, 649)])
def test_the_function_and_track_of_a_real_log_pay_what_it_says(home, log, episodes, steps):
    task = read_task(card(home, CENTRE, REAL / "tracks" / "reinvent_base.npy"))
    replay = replayed(task, log)
    assert (len(replay.episodes), len(replay.logged)) == (episodes, steps)
    assert len(set(replay.logged)) >= 3
    assert_array_equal(replay.new, replay.logged)
    assert all(one.steps > 20 for one in replay.episodes)
    assert {one.ended for one in replay.episodes} == {
        "off track" if log == TRAINING else "lap complete"
    }


@NEEDS_REAL
def test_a_real_log_as_text_pays_the_same_to_its_digits(home):
    lines = TRAINING.read_text().splitlines()[1:]
    said = [text_line([*line.split(","), 0, 1.5]) for line in lines]
    assert re.fullmatch(
        r"SIM_TRACE_LOG:240,1,3\.2000,0\.6831,0\.1678,20\.00,2\.00,11,0\.0000,False,True,0\.7918,1,"
        r"17\.71,749\.174,prepare,0\.00,0,1\.5000\n", said[0]
    )  # fmt: skip
    noise = ["[INFO] reward \x1b[1m computed\n", "[100.0]  " + said[1].strip() + "\tand so on\n"]
    (home / "robo.log").write_text("".join([said[0], *noise, *said[2:], said[-1][:40]]))
    task = read_task(card(home, CENTRE, REAL / "tracks" / "reinvent_base.npy"))
    as_text, as_table = replayed(task, "robo.log"), replayed(task, TRAINING)
    assert [one._replace(log="", progress=0, logged=0, new=0) for one in as_text.episodes] == [
        one._replace(log="", progress=0, logged=0, new=0) for one in as_table.episodes
    ]
    assert (as_text.new == as_table.new).mean() > 0.995
    assert_allclose(as_text.logged, as_table.logged, atol=5e-5)


@pytest.mark.parametrize("reverse", [False, True])
def test_params_of_our_own_logs_are_those_that_the_training_gave(home, reverse):
    task = read_task(card(home, ALL_KEYS, reward="scale = 0.5"))
    paid = drive(task, home / "log", reverse=reverse)
    replay = replayed(task, "log")
    assert [one.steps for one in replay.episodes] == [len(rewards) for rewards in paid]
    gaps = np.abs(replay.new - np.concatenate(paid))
    assert gaps.max() < 0.01  # places have four digits, rewards six
    assert np.ptp(replay.new) > 50


def test_weights_pay_what_the_simulator_pays(home):
    reward = "lane = 1.0\nkeep = 0.3\ndprog = 20.0\nfail = -5.0\n"
    task = read_task(card(home, reward=reward))
    paid = drive(task, home / "log", n_steps=60)
    replay = replayed(task, "log")
    assert {one.ended for one in replay.episodes} >= {"off track"}
    assert_allclose(replay.new, np.concatenate(paid), atol=2e-3)
    assert replay.notes == []


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("name", ["oval", "open.npy"])
def test_progress_begins_where_the_car_starts(home, name, reverse):
    np.save("open.npy", np.load(OVAL)[:60])
    task = read_task(card(home, CENTRE, track=name))
    track = load_track(task.env.track)
    fleet = Fleet(track, 1, "sim4", 100)
    row, reversed_ = np.zeros(1, int), np.array([reverse])
    fleet.start(row, np.array([0.9]), reversed_, [np.random.default_rng(0)])
    began, told = float(fleet.report()["progress"][0]), []
    for _ in range(3):
        fleet.drive(row, np.array([[0.1, 1.0]]))
        told.append(fleet.report())
    rows = {name: np.concatenate([state[name] for state in told]) for name in told[0]}
    nothing = np.zeros(3)
    trace = Trace(
        x=rows["x"], y=rows["y"], yaw=np.rad2deg(rows["heading"]), steer=nothing, throttle=nothing,
        action=nothing.astype(int), reward=nothing, all_wheels_on_track=nothing == 0,
        progress=rows["progress"], closest_waypoint=nothing.astype(int),
        crashes=nothing.astype(int), status="in_progress",
    )  # fmt: skip
    log_of(home / "log", task).train(1, [trace])
    (driven,) = read_driven(home / "log" / "training-simtrace" / "0-iteration.csv", [track])
    assert driven.is_reversed == reverse
    assert driven.first_progress == pytest.approx(began, abs=1e-3)
    assert began > 0.5


@NEEDS_REAL
def test_lap_after_lap_a_weight_pays_the_whole_of_each(home):
    track = REAL / "tracks" / "reinvent_base.npy"
    task = read_task(card(home, track=track, reward="lane = 0.0\ndprog = 1.0\n"))
    paid = [one.new for one in replayed(task, EVALUATION).episodes]
    assert_allclose(paid, 1, atol=0.01)  # the first begins in the step that is not paid
    assert_allclose(paid[1:], 1, atol=1e-9)


def edited(path, edit):
    """Change the cells of each row of a simtrace, by column."""
    head, *lines = path.read_text().splitlines()
    rows = [dict(zip(COLUMNS, line.split(","), strict=True)) for line in lines]
    for i, row in enumerate(rows):
        edit(i, row)
    path.write_text("\n".join([head, *(",".join(row.values()) for row in rows)]) + "\n")


COUNTS = """
calls = 0
def reward_function(params):
    global calls
    calls += 1
    return calls
"""


def test_no_function_is_called_where_deepracer_calls_none(home):
    task = read_task(card(home, COUNTS))
    n, m = map(len, drive(task, home / "log", n_steps=10))
    assert replayed(task, "log").new.tolist() == list(range(1, n + m + 1))  # ours: every step

    def as_deepracers(i, row):
        row["tstamp"] = str(float(row["tstamp"]) + 0.001 * (i % 3))  # whose steps vary
        row["episode_status"] = "pause" if row["steps"] == "5.0" else row["episode_status"]
        row["action"] = "[ 3.2 0.5]"

    edited(home / "log" / "training-simtrace" / "0-iteration.csv", as_deepracers)
    replay = replayed(task, "log")
    assert [one.steps for one in replay.episodes] == [n - 2, m - 2]
    assert replay.new.tolist() == list(range(1, n + m - 3))


def test_each_folder_of_logs_has_a_copy_of_the_function(home):
    task = read_task(card(home, COUNTS))
    for worker in ("0", "1"):
        drive(task, home / "log" / worker, n_steps=3)
    replay = replayed(task, "log")
    assert replay.new.tolist() == [1, 2, 3, 4, 5, 6] * 2
    assert [one.log for one in replay.episodes] == ["0/0", "0/0", "1/0", "1/0"]
    table = home / "log" / "0" / "training-simtrace" / "0-iteration.csv"
    table.with_name("1-iteration.csv").write_bytes(table.read_bytes())
    assert replayed(task, "log/0").new.tolist() == list(range(1, 13))  # of all iterations
    assert len(replayed(task, "log/0", "log/0/training-simtrace/0-iteration.csv").new) == 18


def test_a_log_of_another_track_is_refused(home):
    task = read_task(card(home, CENTRE))
    drive(task, home / "log", n_steps=20)
    with pytest.raises(CardError, match=r"its track is 12\.00 m long, and the card's, 'wide-loop'"):
        replayed(task.with_settings(["env.track=wide-loop"]), "log")
    np.save("aside.npy", np.load(OVAL) + 0.8)
    with pytest.raises(CardError, match=r"in \d+% of its steps the car is off .* track, 'aside'"):
        replayed(task.with_settings(["env.track=aside.npy"]), "log")


@NEEDS_REAL
def test_a_track_that_is_nearly_as_long_is_another(home):
    with pytest.raises(CardError, match="the car is off the card's track, 'reinvent-like'"):
        replayed(read_task(card(home, CENTRE, "reinvent-like")), TRAINING)


def test_a_line_that_fails_is_named_with_its_step_and_episode(repaint, home):
    task = card(home, CENTRE)
    drive(read_task(task), home / "log", n_steps=4)
    card(home, 'def reward_function(params):\n    return 1 / (params["steps"] - 3)\n')
    said = repaint("tasks", "replay", "log", "--task", task)
    assert said.code == CardError.exit_code
    assert (
        "mine.py:2: ZeroDivisionError: float division by zero (at step 3 of episode 0 in "
        "0-iteration.csv)" in said.err
    )
    assert not (home / "mine-replay.png").exists()


def test_what_logs_do_not_hold_is_said(repaint, home):
    source = """def reward_function(params):
    print("hello")
    return len(params["objects_location"]) + params['closest_objects'][0]
"""
    task = card(home, source)
    drive(read_task(task), home / "log", n_steps=4)
    said = repaint("tasks", "replay", "log", "--task", task)
    assert said.out.count("hello") == 1
    assert (
        "note: logs hold no other cars and no boxes: closest_objects, objects_location in params "
        "say that there are none\nnote: mine.py prints 8 lines, such as 'hello'\n" in said.out
    )
    said = repaint("tasks", "replay", "log", "--task", "racer-avoid")
    assert said.code == CardError.exit_code
    assert "found clear: logs hold no other cars; leave it out" in said.err


def test_the_table_fits_a_terminal_and_says_how_rewards_relate(repaint, home):
    task = card(home, CENTRE)
    drive(read_task(task), home / "log" / ("a" * 40), n_steps=30)
    drive(read_task(task), home / "log" / "b", n_steps=5)
    said = repaint("tasks", "replay", "log", "--task", task)
    assert (said.code, said.err) == (0, "")
    lines = said.out.splitlines()
    assert max(map(len, lines)) <= 80
    assert lines[0].split() == ["log", "ended", "episode", "steps", "progress", "logged", "new"]
    assert lines[3].split()[:2] == ["b/0", "in"]
    assert re.match(r"…a{17}/0 +\w+", lines[1])
    assert re.search(r"\nmine\.py over 4 episodes of \d+ steps:\n", said.out)
    n = re.search(r"  paid as logged     (\d+) of (\d+) steps\n", said.out).groups()
    assert n[0] == n[1]
    assert "  correlation        1.00 over episodes, 1.00 over steps\n" in said.out
    assert said.out.endswith("mine-replay.png\nnext: repaint train-teacher --task mine.toml\n")
    assert (home / "mine-replay.png").read_bytes().startswith(b"\x89PNG")


def test_many_episodes_are_summed_up_and_json_holds_all(repaint, home, unpainted):
    task = card(home, CENTRE)
    for k in range(21):
        drive(read_task(task), home / "log" / str(k), n_steps=2)
    said = repaint("tasks", "replay", "log", "--task", task)
    lines = said.out.splitlines()
    assert lines[0].split() == ["from", "to", "episodes", "laps", "progress", "logged", "new"]
    record = json.loads(repaint("tasks", "replay", "log", "--task", task, "--json").out)
    progress = f"{np.mean([one['progress'] for one in record['episodes'][:2]]):.1f}"
    assert lines[1].split()[:7] == ["0/0:", "0", "0/0:", "1", "2", "0", progress]
    assert lines.index("") == 22
    assert (len(record["episodes"]), record["steps"]) == (42, 84)
    assert record["steps_paid_as_logged"] == 84
    assert (
        record["correlation_over_episodes"] == pytest.approx(1)
        or record["correlation_over_episodes"] is None
    )
    assert set(record["episodes"][0]) == set(ReplayedEpisode._fields)


def test_a_picture_of_ones_own_is_left_alone(repaint, home, unpainted):
    task = card(home, CENTRE)
    drive(read_task(task), home / "log", n_steps=2)
    (home / "mine-replay.png").write_bytes(b"mine")
    said = repaint("tasks", "replay", "log", "--task", task)
    assert said.code == StoreError.exit_code
    assert "not written by repaint; name another with --plot" in said.err
    assert (home / "mine-replay.png").read_bytes() == b"mine"
    for _ in range(2):
        assert repaint("tasks", "replay", "log", "--task", task, "--plot", "new.svg").code == 0
    said = repaint("tasks", "replay", "log", "--task", task, "--plot", "new.jpg")
    assert said.code == UsageError.exit_code
    assert "expected --plot with a name that ends in .png or .svg, found 'new.jpg'" in said.err


def test_only_races_are_replayed(repaint, home):
    said = repaint("tasks", "replay", "log", "--task", "reacher")
    assert said.code == CardError.exit_code
    assert "expected --task with a racing task, found 'reacher'" in said.err


@pytest.mark.parametrize(
    ("found", "labels", "n_left"),
    [
        (["training-simtrace/10", "training-simtrace/9"], ["9", "10"], 0),
        (["training-simtrace/0", "evaluation-1/evaluation-simtrace/0"], ["0"], 1),
        (["1/training-simtrace/0", "0/training-simtrace/0"], ["0/0", "1/0"], 0),
        (["sim-trace/training/2026/training-simtrace/3"], ["2026/3"], 0),
        (["deepracer/seed-1/training-simtrace/0"], ["seed-1/0"], 0),
        (["evaluation-1/evaluation-simtrace/0"], ["evaluation-1/0"], 0),
        (["drfc1-training-12"], ["drfc1-training-12"], 0),
    ],
)
def test_logs_are_found_in_deepracers_folders(tmp_path, found, labels, n_left):
    for name in found:
        path = tmp_path / f"{name}-iteration.csv"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")
    files, notes = find_logs([tmp_path])
    assert [file.label for file in files] == labels
    assert len(notes) == bool(n_left)
    if n_left:
        assert notes[0].startswith(f"{n_left} log of evaluations left out")


def test_texts_are_found_where_there_are_no_tables(tmp_path):
    (tmp_path / "logs" / "training").mkdir(parents=True)
    (tmp_path / "logs" / "training" / "a-robomaker.log").write_text("")
    assert [file.label for file in find_logs([tmp_path])[0]] == ["a-robomaker"]


def test_where_no_logs_are_is_said(home):
    task = read_task(card(home, CENTRE))
    (home / "empty").mkdir()
    (home / "words.log").write_text("nothing\nof interest\n")
    for place, message in (
        ("absent", "expected logs at 'absent', found nothing there"),
        ("empty", r"expected logs in 'empty', \*-iteration.csv or \*.log, found none"),
        ("words.log", r"words.log: expected a simtrace .* found no step of an episode"),
    ):
        with pytest.raises(NotFound, match=message):
            replayed(task, place)


STEP = "SIM_TRACE_LOG:0,1,1.0,2.0,3.0,0.00,1.00,2,0.5,False,True,1.0,3,12.00,0.1,in_progress,0.0\n"


def test_a_damaged_text_is_refused_by_what_is_wrong(tmp_path):
    path = tmp_path / "x.log"
    for text, message in (
        (STEP.replace(",in_progress,0.0", ""), "at least 16 values after SIM_TRACE_LOG:, found 15"),
        (STEP.replace("1.0,2.0", "east,2.0"), "could not convert string to float: 'east'"),
        (STEP.replace("1.0,2.0", "nan,2.0"), "expected numbers within"),
        (STEP.replace("1.0,2.0", "1e300,2.0"), "expected numbers within"),
    ):
        path.write_text(text)
        with pytest.raises(CheckpointError, match=message):
            read_episodes(path)
    path.write_bytes(b"\xff\xfe\n" + STEP.encode() + STEP.encode()[:-1])  # still being written
    (episode,) = read_episodes(path)
    assert episode.trace.crashes.tolist() == [0]
    path.write_text(STEP[:-1] + ",2\t4,5\n")  # what a tab parts is not of the step
    (episode,) = read_episodes(path)
    assert episode.trace.crashes.tolist() == [2]
    assert (len(episode.trace), episode.trace.x[0], episode.track_length) == (1, 1.0, 12.0)


def test_an_episode_begins_where_steps_begin_anew(tmp_path):
    again = STEP.replace("0,1,", "0,2,", 1)
    (tmp_path / "x.log").write_text(STEP + again + STEP + again + STEP.replace(":0,", ":1,"))
    episodes = read_episodes(tmp_path / "x.log")
    assert [(one.number, len(one.trace)) for one in episodes] == [(0, 2), (0, 2), (1, 1)]


def test_a_correlation_needs_two_that_vary():
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(2, 50))
    assert correlation(x, 3 * x + 1) == pytest.approx(1)
    assert correlation(x, y) == pytest.approx(np.corrcoef(x, y)[0, 1])
    assert correlation(x, np.ones(50)) is None
    assert correlation(x[:1], y[:1]) is None
    assert correlation(x[:3], y[:3]) is None  # which would say nothing
    assert correlation_text(x, np.ones(50)) == "none"
    assert correlation_text(np.array([0, 0, 1, 1]), np.array([0, 1, 0, 1.001])) == "0.00"


def test_the_picture_shows_episodes_of_one_kind_and_of_both(tmp_path):
    for laps in ([True], [False, False], [True, False, True]):
        rewards = np.arange(len(laps), dtype=float)
        plot_replay(rewards, 2 * rewards, np.array(laps), tmp_path / "x.svg", "a title")
        text = (tmp_path / "x.svg").read_text()
        assert ("whole lap" in text) == any(laps)
        assert ("ended before a lap" in text) == (not all(laps))


def test_what_a_replay_says_of_episodes():
    episode = ReplayedEpisode("0", 3, 10, 99.5, "off track", False, 1.0, 2.0)
    replay = Replay([episode, episode._replace(whole=True, new=4.0)], np.ones(1), np.ones(1), [])
    assert [part.tolist() for part in replay.returns] == [[1, 1], [2, 4]]
    assert replay.whole.tolist() == [False, True]
