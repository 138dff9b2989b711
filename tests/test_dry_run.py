"""`--dry-run`: a card of what would run, the time it would take, and no trace of it."""

import os
import re
import subprocess
import sys
import tempfile
import tomllib
from math import inf

import pytest
from small_runs import QUICK, add_teacher, files_below

from repaint_cli.runs.estimate import Estimate
from repaint_cli.tasks.card_files import read_task

pytestmark = pytest.mark.usefixtures("unpainted")  # no picture of a run is looked at

REPAINT = ["transfer", "--task", "reacher", "--teacher", "old-hand", *QUICK, "--dry-run"]
TEACHER = ["train-teacher", "--task", "reacher", "--name", "mine", *QUICK, "--dry-run"]


@pytest.fixture
def teacher(home):
    return add_teacher(home / "home" / "zoo")


@pytest.fixture
def no_trace(home, teacher, monkeypatch, tmp_path_factory):
    """Nothing that a test does leaves a file, here or in the temporary folder."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path_factory.mktemp("temporary")))
    before = files_below(home), os.environ.get("XDG_CACHE_HOME")
    yield
    assert (files_below(home), os.environ.get("XDG_CACHE_HOME")) == before
    assert {path.name for path in home.iterdir()} <= {"home"}
    assert os.listdir(tempfile.gettempdir()) == []


@pytest.mark.usefixtures("no_trace")
def test_what_is_printed_is_the_card_that_would_be_trained(repaint, home, teacher, monkeypatch):
    monkeypatch.setattr("repaint_cli.runs.estimate.LONG_SECONDS", inf)  # the first may compile
    said = repaint(*REPAINT, "--seeds", 2, "--method", "kickstart", "--set", "net.hidden=[8]")
    assert said.code == 0
    for line in (
        "# task: reacher",
        "# method: kickstart",
        "# seeds: 0, 1",
        f"# teacher: old-hand, {teacher}",
        "#   ppo.n_iterations = 2 (card: 60)",
        "#   net.hidden = [8] (card: [64, 64])",
        "#   transfer.instance = 0 (card: 1), by the method",
    ):
        assert f"{line}\n" in said.out
    assert re.search(r"# folder: runs/reacher/kickstart-old-hand-\S+ \(with the time", said.out)
    assert re.search(
        r"# kickstart: about [\d.]+ s for 2 iterations .* took [\d.]+, [\d.]+ s", said.out
    )
    data = tomllib.loads(said.out)
    assert (data["net"]["hidden"], data["transfer"]["instance"]) == ([8], 0)
    assert set(data) >= {"env", "reward", "net", "ppo", "transfer", "select", "eval"}
    (home / "home" / "told.toml").write_text(said.out)
    card = read_task(str(home / "home" / "told.toml"))
    assert card.ppo.n_steps == 204
    (home / "home" / "told.toml").unlink()


@pytest.mark.usefixtures("no_trace")
def test_a_teacher_that_would_be_made_is_named_and_not_made(repaint, home):
    said = repaint(*TEACHER)
    assert said.code == 0
    assert f"# teacher that it makes: {home}/home/zoo/mine.safetensors\n" in said.out
    assert "by the method" not in said.out
    assert (
        said.err == "training first iterations in a temporary folder, to tell how long it takes\n"
    )


@pytest.mark.usefixtures("no_trace")
def test_a_comparison_takes_a_preset(repaint):
    said = repaint(
        *("compare", "--task", "reacher", "--seeds", 1, *QUICK[:2], *QUICK[4:], "--dry-run"),
        *("--methods", "scratch", "--preset", "paper"),
    )
    assert said.code == 0, said.err
    assert "#   transfer.iterations = 15 (card: 4)" in said.out


@pytest.mark.usefixtures("no_trace")
def test_a_comparison_tells_of_each_method(repaint):
    said = repaint(
        *("compare", "--task", "reacher", "--teacher", "old-hand", "--seeds", 1, *QUICK[:2]),
        *QUICK[4:], "--methods", "scratch,repaint", "--jobs", 2, "--dry-run",
    )  # fmt: skip
    assert said.code == 0, said.err
    assert [line for line in said.out.splitlines() if "# method" in line] == [
        "# method: scratch", "# method: repaint",
    ]  # fmt: skip
    assert re.search(r"# scratch: about .*\n# repaint: about .*\n# all, one after the", said.out)
    assert "with --jobs 2 less, at best 1/2 of it" in said.out


@pytest.mark.usefixtures("no_trace")
@pytest.mark.parametrize(
    ("words", "code", "line"),
    [
        ([*REPAINT[:3], "--teacher", "nobody", *QUICK, "--dry-run"], 2, "unknown teacher 'nobody'"),
        ([*REPAINT, "--set", "ppo.n_steps=3"], 3, "expected ppo.n_steps of at least ppo.n_envs"),
        ([*TEACHER[:4], "old-hand", *QUICK, "--dry-run"], 7, "has a teacher 'old-hand' already"),
        (["transfer", "--resume", "run", "--dry-run"], 2, "leave out --dry-run beside --resume"),
        (["compare", "run", "--dry-run"], 2, "--dry-run is for --task; leave it out"),
    ],
)
def test_what_would_fail_fails(repaint, words, code, line):
    said = repaint(*words)
    assert said.code == code
    assert line in said.err


def test_nothing_is_written_into_a_new_home(tmp_path):
    names = {"HOME": str(tmp_path), "NUMBA_DISABLE_JIT": "1", "OMP_NUM_THREADS": "1"}
    unset = ("REPAINT_HOME", "XDG_DATA_HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR")
    env = {name: value for name, value in os.environ.items() if name not in unset} | names
    env["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))
    words = [*map(str, TEACHER), "--iterations", "1", "--set", "ppo.compiled=false"]
    done = subprocess.run(
        [sys.executable, "-m", "repaint_cli", *words],
        capture_output=True, text=True, cwd=tmp_path, env=env, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "# scratch: about" in done.stdout
    assert list(tmp_path.iterdir()) == []


def test_the_estimate_counts_the_first_iteration_once():
    assert Estimate((5.0, 1.0, 2.0), 11).seconds == pytest.approx(5 + 10 * 1.5)
    assert Estimate((5.0,), 3).seconds == 15
