"""Runs under adverse conditions: each ends well, or says in a line what was wrong."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import pytest
from failing_env import card
from small_runs import QUICK, add_teacher
from test_runs import record_of

from repaint_cli.errors import CardError, DivergedError
from repaint_cli.files import atomic
from repaint_cli.files.paths import PACKAGE
from repaint_cli.runs import start
from repaint_cli.runs.owner import new_run
from repaint_cli.runs.reader import read_run
from repaint_cli.tasks.card_files import read_task

PATH = os.pathsep.join(map(str, (Path(__file__).parent / "fixtures", PACKAGE.parent)))
TRAIN = ["transfer", "--method", "scratch", "--task", "bad.toml", "--run", "run"]


def process(words, **options):
    """Type a command as another process, from which the environments beside this file are seen."""
    env = os.environ | {"PYTHONPATH": PATH, "OMP_NUM_THREADS": "1"} | options.pop("env", {})
    return subprocess.Popen(
        [sys.executable, "-m", "repaint_cli", *map(str, words)],
        env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **options,
    )  # fmt: skip


def table(path, *columns):
    with path.open(encoding="utf-8", newline="") as file:
        return [[row[name] for name in columns] for row in csv.DictReader(file)]


def said_by(words, **options):
    child = process(words, text=True, **options)
    out, err = child.communicate(timeout=120)
    return child.returncode, out, err


@pytest.mark.parametrize(
    ("failure", "error", "text"),
    [
        ("fails", CardError, "failed in a step: ValueError: the arm fell off; see where with"),
        ("fails when reset", CardError, "when it was reset: RuntimeError: no simulator today;"),
        ("nan reward", DivergedError, "a reward that is not, in environment 0 at step 3"),
        ("infinite reward", DivergedError, "a reward that is not, in environment 0 at step 3"),
        ("nan observation", DivergedError, "found an observation that is not, in environment 0"),
    ],
)  # fmt: skip
def test_an_environment_that_fails_is_blamed_in_a_line(repaint, home, failure, error, text):
    (home / "bad.toml").write_text(card(failure))
    said = repaint(*TRAIN)
    assert said.code == error.exit_code
    assert said.err.startswith("error: ")
    assert text in said.err
    assert said.err.count("\n") == 1


def test_an_environment_that_hangs_ends_with_the_scheduler_s_word(home):
    (home / "bad.toml").write_text(card("hangs"))
    child = process([*TRAIN, "--run", "run"], text=True)
    while not (home / "run" / "metrics.csv").exists():
        time.sleep(0.1)
    time.sleep(1)
    child.send_signal(signal.SIGTERM)
    out, err = child.communicate(timeout=30)
    assert (child.returncode, err) == (143, "")
    assert out.endswith("next: repaint transfer --resume run\n")


def test_an_environment_that_never_ends_an_episode_is_refused(repaint, home):
    (home / "bad.toml").write_text(card(name="Endless"))
    said = repaint(*TRAIN)
    assert said.code == CardError.exit_code
    assert (
        "'failing_env:Endless-v0' has no time limit, so an evaluation might never end" in said.err
    )
    assert not (home / "run").exists()


def test_episodes_of_a_single_step(repaint, home):
    (home / "bad.toml").write_text(card("ends at once"))
    assert repaint(*TRAIN).code == 0
    rows = table(home / "run" / "metrics.csv", "eval_length", "episode_length", "env_steps")
    assert rows == [["1", "1", "28"], ["1", "1", "56"], ["1", "1", "84"]]


@pytest.mark.parametrize(("scale", "alarm"), [(1, False), (1e6, True)])
def test_rewards_a_million_times_too_large_are_said_once(repaint, home, scale, alarm):
    (home / "bad.toml").write_text(card(scale=scale))
    said = repaint(*TRAIN)
    assert said.code == 0
    text = "warning: iteration 1: rewards are large (the critic's mean squared error is "
    assert said.out.count(text) == alarm
    kinds = [found["kind"] for found in record_of(home / "run")["alarms"]]
    assert kinds == ["large-rewards"] * alarm


def test_rewards_beyond_all_numbers_end_the_run_in_a_line(repaint, home):
    (home / "bad.toml").write_text(card(scale=1e30))
    said = repaint(*TRAIN)
    assert said.code == DivergedError.exit_code
    assert said.err.count("\n") == 1
    assert "rewards of a smaller scale may help" in said.err


def test_a_clock_that_jumps_changes_no_run(repaint, home, monkeypatch):
    (home / "bad.toml").write_text(card())
    times = iter(range(2_000_000_000, 0, -3_000_000))
    monkeypatch.setattr(time, "time", lambda: float(next(times)))
    assert repaint(*TRAIN).code == 0
    monkeypatch.undo()
    seconds = read_run(home / "run").rows["seconds"][0]
    assert 0 < seconds[0] < seconds[1] < seconds[2] < 60


def test_two_runs_that_begin_in_a_second_have_folders_of_their_own(home, monkeypatch):
    monkeypatch.setattr(start, "stamp", lambda: "20210718-120000")
    folders = []
    with ExitStack() as stack:
        for _ in range(3):
            plan = start.plan_transfer(read_task("reacher"), [], [0], "scratch", "ppo", [], None, 1)
            folders.append(stack.enter_context(new_run(plan)).plan.folder)
    assert [folder.name for folder in folders] == [
        "scratch-20210718-120000", "scratch-20210718-120000-2", "scratch-20210718-120000-3",
    ]  # fmt: skip


def test_without_a_terminal_and_without_utf8(home):
    (home / "bad.toml").write_text(card())
    plain = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": ""}
    code, out, err = said_by(
        TRAIN, env=plain | {"PYTHONWARNDEFAULTENCODING": "1"}, stdin=subprocess.DEVNULL,
        start_new_session=True,
    )  # fmt: skip
    assert (code, [line for line in err.splitlines() if "repaint_cli" in line]) == (0, [])
    assert out.startswith("iteration 1/3 \\xb7 ppo \\xb7 ")
    code, out, err = said_by(["transfer", "--task", "bad.toml", "--method", "β"], env=plain)
    assert (code, out) == (2, "")
    assert err.startswith("error: unknown method ")
    assert out.isascii()
    assert json.loads((home / "run" / "run.json").read_text())["state"] == "finished"


@pytest.mark.parametrize("words", [[*TRAIN, "--iterations", 200], ["tasks", "show", "reacher"]])
def test_a_reader_that_leaves_is_no_error(home, words):
    (home / "bad.toml").write_text(card())
    with process(words) as child:
        child.stdout.readline()
        child.stdout.close()
        assert child.wait(120) in (1, 128 + signal.SIGPIPE)
        assert child.stderr.read() == b""


def test_paths_with_spaces_and_umlauts(repaint, home, monkeypatch):
    monkeypatch.setenv("REPAINT_HOME", str(home / "my own ζoo"))
    add_teacher(home / "my own ζoo" / "zoo")
    folder = home / "a run" / "of Jürgen's"
    said = repaint(
        "transfer", "--task", "reacher", "--teacher", "old-hand", "--run", folder, *QUICK
    )
    assert said.code == 0
    assert f"next: repaint eval '{folder}'".replace("'s'", "'\"'\"'s'") in said.out
    assert repaint("transfer", "--resume", folder, "--iterations", 3).code == 0
    assert repaint("eval", folder, "--episodes", 2).code == 0
    assert repaint("zoo", "export", "old-hand", folder / "for export").code == 0


def test_code_that_a_run_brings_along_waits_to_be_allowed(repaint, home, monkeypatch):
    (home / "bad.toml").write_text(card())
    assert repaint(*TRAIN).code == 0
    assert repaint("eval", "run", "--episodes", 1).code == 0  # begun here
    monkeypatch.setenv("REPAINT_HOME", str(home / "somebody-else"))
    for words in (["eval", "run"], ["transfer", "--resume", "run", "--iterations", 4]):
        said = repaint(*words)
        assert said.code == CardError.exit_code
        assert (
            "run would run the module of failing_env:Failing-v0, with which nothing was" in said.err
        )
        assert said.err.endswith("then: repaint tasks trust run\n")
    monkeypatch.setattr("typer.confirm", lambda question: False)
    assert repaint("tasks", "trust", "run").out == "nothing allowed\n"
    assert repaint("eval", "run").code == CardError.exit_code
    said = repaint("tasks", "trust", "run", "--yes")
    assert said.out == "allowed: the module of failing_env:Failing-v0\n"
    assert repaint("eval", "run", "--episodes", 1).code == 0
    assert repaint("transfer", "--resume", "run", "--iterations", 4).code == 0
    assert len((home / "somebody-else" / "trusted.txt").read_text().splitlines()) == 1


def test_a_user_s_umask_is_kept(home, tmp_path):
    words = [sys.executable, "-m", "repaint_cli", "tasks", "copy", "reacher", "mine.toml"]
    subprocess.run(words, check=True, umask=0o077, capture_output=True, timeout=60)
    assert (home / "mine.toml").stat().st_mode & 0o777 == 0o600


def test_what_is_half_written_is_nobody_else_s(repaint, home, monkeypatch):
    (home / "bad.toml").write_text(card())
    modes, real = set(), os.fsync

    def fsync(handle):
        modes.add(os.fstat(handle).st_mode & 0o077)
        real(handle)

    monkeypatch.setattr(atomic.os, "fsync", fsync)
    assert repaint(*TRAIN).code == 0
    assert 0 in modes
    assert modes <= {0, 0o055}  # files are ours alone; folders are synced, too
