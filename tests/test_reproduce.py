"""`repaint reproduce`, typed: what it trains, writes and says, and how it goes on."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from small_experiment import small
from small_runs import add_teacher, files_below
from test_files import full_disk

from repaint_cli.errors import CheckpointError, NotFound
from repaint_cli.files.paths import PACKAGE

sys.path.append(str(Path(__file__).parents[1] / "tools"))
import finished_runs

pytestmark = pytest.mark.usefixtures("unpainted")  # no picture of a run is looked at

SMOKE = ["--scale", "smoke"]


@pytest.fixture
def mine(home):
    """An experiment of one's own, and its teacher."""
    add_teacher(home / "home" / "zoo")
    (home / "mine.toml").write_text(small())
    return home


def is_a_line(said, code, *texts):
    assert said.code == code, said.err
    errors = [line for line in said.err.splitlines() if line.startswith("error: ")]
    assert len(errors) == 1
    for text in texts:
        assert text in errors[0]


def test_an_experiment_is_trained_once_drawn_and_tabled(repaint, mine):
    said = repaint("reproduce", "mine.toml", *SMOKE)
    assert said.code == 0, said.err
    assert (
        "mine (no figure), smoke: 2 runs of 2 seeds × 2 iterations, 2 to train, about" in said.err
    )
    assert re.search(r"2 of 2: reacher, kickstart from old-hand, wrote reproduce/runs/", said.err)
    folder = mine / "reproduce" / "smoke" / "mine"
    names = ["curves.csv", "experiment.json", "table.md"]
    figures = [f"{along}.{kind}" for along in ("iterations", "steps") for kind in ("png", "svg")]
    assert sorted(path.name for path in folder.iterdir()) == sorted([*names, *figures])
    record = json.loads((folder / "experiment.json").read_text())
    assert (record["scale"], record["finished"], record["seeds"]) == ("smoke", True, 2)
    assert record["command"] == "repaint reproduce mine.toml --scale smoke"
    assert len((folder / "curves.csv").read_text().splitlines()) == 1 + 2 * 2 * 2
    assert "no number here is a result" in (folder / "table.md").read_text()
    for runs in record["runs"].values():
        for run in runs.values():
            assert json.loads((folder / run / "run.json").read_text())["state"] == "finished"

    dated = (folder / "experiment.json").read_text().replace(record["date"], "2021-07-18")
    (folder / "experiment.json").write_text(dated)
    before = files_below(mine / "reproduce" / "runs")
    again = repaint("reproduce", "run", "mine.toml", *SMOKE)
    assert (again.code, again.out) == (0, said.out)
    assert "0 to train" in again.err
    assert files_below(mine / "reproduce" / "runs") == before
    assert (folder / "experiment.json").read_text() == dated  # the day on which it was trained


def test_what_was_stopped_goes_on_and_a_teacher_is_made_first(repaint, mine, monkeypatch):
    made = '[[teachers]]\nname = "new-hand"\ntask = "reacher-gentle"\niterations = 2\n'
    (mine / "mine.toml").write_text(small(teacher="new-hand", more=made))
    with full_disk(40_000):
        said = repaint("reproduce", "mine.toml", *SMOKE)
    is_a_line(
        said, 1, "2 of 3 runs failed: reproduce/runs/reacher-gentle-scratch-", "File too large",
        "finished runs are kept; go on with: repaint reproduce mine.toml --scale smoke",
    )  # fmt: skip
    (begun,) = (mine / "reproduce" / "runs").glob("reacher-gentle-*")
    assert not list((mine / "reproduce" / "teachers").glob("*/*"))  # of a run that failed
    said = repaint("reproduce", "mine.toml", *SMOKE)
    assert said.code == 0, said.err
    assert json.loads((begun / "run.json").read_text())["state"] == "finished"
    (teacher,) = (mine / "reproduce" / "teachers").glob("*/new-hand.safetensors")
    record = json.loads(
        next((mine / "reproduce" / "runs").glob("*kickstart*/run.json")).read_text()
    )
    assert [found["file"] for found in record["teachers"]] == [str(teacher)]
    assert not list((mine / "home" / "zoo").glob("new-hand*"))

    monkeypatch.setattr(finished_runs, "KEPT", mine / "kept")
    kept = list(finished_runs.keep(mine / "reproduce"))
    assert len(kept) == 3
    restored = list(finished_runs.restore(mine / "elsewhere"))
    assert sorted(path.name for path in restored) == sorted(path.name for path in kept)
    assert not list(finished_runs.restore(mine / "elsewhere"))
    said = repaint("reproduce", "mine.toml", *SMOKE, "--into", "elsewhere")
    assert said.code == 0, said.err
    assert "0 to train" in said.err

    metrics = begun / "metrics.csv"
    metrics.write_text(metrics.read_text().replace("eval_return", "mean_return"))
    said = repaint("reproduce", "mine.toml", *SMOKE)
    is_a_line(said, CheckpointError.exit_code, "expected one column 'eval_return'")


def test_a_copy_is_one_s_own(repaint, home):
    said = repaint("reproduce", "copy", "reacher", "my.toml")
    assert said.out == "wrote my.toml\nnext: repaint reproduce my.toml --scale smoke\n"
    is_a_line(repaint("reproduce", "copy", "reacher", "my.toml"), 7, "my.toml exists already")
    is_a_line(repaint("reproduce", "copy", "reacher", "my.txt"), 7, "ends in .toml")
    listed = repaint("reproduce", "list")
    assert listed.code == 0
    assert "single-car-beta-schedule" in listed.out
    assert "20×150" in listed.out


WRONG = [
    (["reecher"], NotFound.exit_code, "unknown experiment 'reecher'; did you mean reacher"),
    (["my.toml"], NotFound.exit_code, "there is no experiment at 'my.toml'; start one: repaint"),
    (["reacher", "--scale", "huge"], 2, "Invalid value for '--scale'"),
    (["reacher", "--jobs", 0], 2, "expected at least 1 job, found 0"),
    (["multi-car-5-layer", "--scale", "night"], 2,
     "has no scale 'night', expected --scale smoke or paper"),
    (["--scale", "smoke"], 2, "Missing argument"),
]  # fmt: skip


@pytest.mark.parametrize(("words", "code", "text"), WRONG)
def test_what_is_wrong_is_said_and_nothing_is_written(repaint, home, words, code, text):
    is_a_line(repaint("reproduce", *words), code, text)
    assert not files_below(home)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="needs /proc to find the process")
def test_a_worker_that_is_killed_is_named_and_the_command_goes_on(repaint, mine):
    more = '[scales.night]\nseeds = 1\niterations = 150\nseconds = 0.1\nsettings = ["{}"]'
    quick = '", "'.join(["ppo.n_steps=204", "ppo.n_envs=4", "ppo.n_epochs=1", "eval.episodes=2"])
    (mine / "mine.toml").write_text(small(more=more.format(quick)))
    env = os.environ | {"PYTHONPATH": str(PACKAGE.parent), "OMP_NUM_THREADS": "1"}
    words = [sys.executable, "-m", "repaint_cli", "reproduce", "mine.toml", "--jobs", "2"]
    words += ["--retries", "0"]
    with subprocess.Popen(words, env=env, text=True, stdout=-1, stderr=-1) as parent:
        os.kill(worker_of(parent.pid), signal.SIGKILL)
        _, err = parent.communicate(timeout=60)
    said = SimpleNamespace(code=parent.returncode, err=err)
    is_a_line(
        said, 1, "was killed (signal 9)", "go on with: repaint reproduce mine.toml --scale night"
    )
    done = subprocess.run(words, env=env, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert "kickstart" in done.stdout


def worker_of(parent):
    """The process id of the first process that trains for another, once its run has begun."""
    for _ in range(600):
        tasks = Path(f"/proc/{parent}/task").glob("*/children")  # of each thread
        children = " ".join(task.read_text() for task in tasks).split()
        if children and list(Path("reproduce").glob("runs/*/checkpoint*")):
            return int(children[0])
        time.sleep(0.1)
    raise AssertionError("nothing was begun")


def test_a_run_that_is_automatic_has_its_teachers_play_when_it_begins(repaint, home):
    auto = '[{ name = "plain command", auto = true }]'
    (home / "mine.toml").write_text(small(auto, "reacher-gentle"))
    said = repaint("reproduce", "mine.toml", *SMOKE)
    assert said.code == 0, said.err
    (folder,) = (home / "reproduce" / "runs").iterdir()
    record = json.loads((folder / "run.json").read_text())
    assert record["task"]["transfer"]["start"] == "teacher"
    assert [one["name"] for one in record["ranked"]][-1] == "untrained"
    said = repaint("reproduce", "mine.toml", *SMOKE)
    assert "0 to train" in said.err
