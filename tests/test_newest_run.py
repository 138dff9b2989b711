"""The newest run, wherever its folder lies, and messages that name runs."""

import json
import os
from pathlib import Path

import pytest
from small_runs import QUICK

from repaint_cli.errors import NotFound
from repaint_cli.runs import elsewhere
from repaint_cli.runs.elsewhere import remember, runs_from_here
from repaint_cli.runs.reader import newest_named, newest_runs

pytestmark = pytest.mark.usefixtures("unpainted")  # no picture of a run is looked at

SCRATCH = ["transfer", "--task", "reacher", "--method", "scratch", *QUICK]


def pretend(folder, n):
    """Make what looks like a run that wrote at time n."""
    folder.mkdir(parents=True)
    for file in ("run.json", "metrics.csv", "checkpoint.safetensors"):
        (folder / file).touch()
    os.utime(folder / "metrics.csv", (n, n))
    remember(folder)
    return folder


def test_eval_plays_the_newest_run_whatever_its_folder_is_called(repaint, home, monkeypatch):
    repaint(*SCRATCH)
    repaint(*SCRATCH, "--run", "my/folder")
    said = repaint("eval")
    assert said.code == 0, said.err
    assert "wrote my/folder/: eval.json" in said.out
    (home / "other").mkdir()
    monkeypatch.chdir(home / "other")
    said = repaint("eval")  # another folder has no run
    assert said.err.startswith("error: expected a run below runs/, found none; train: ")


def test_runs_are_found_by_where_they_were_begun(home, tmp_path_factory, monkeypatch):
    far = pretend(tmp_path_factory.mktemp("far") / "away", 3)
    pretend(Path("near"), 2)
    pretend(Path("runs/reacher/usual"), 1)
    assert newest_runs() == [far, Path("near"), Path("runs/reacher/usual")]
    noted = (home / "home" / "runs.jsonl").read_text()
    remember(Path("near"))
    assert (home / "home" / "runs.jsonl").read_text() == noted
    assert "usual" not in noted
    (far / "run.json").unlink()
    assert newest_runs() == [Path("near"), Path("runs/reacher/usual")]
    monkeypatch.chdir(far)
    assert newest_runs() == []


def test_a_damaged_list_is_passed_over_and_none_stops_no_training(home, monkeypatch):
    remember(Path("near"))
    lines = home / "home" / "runs.jsonl"
    odd = ["", "{", "3", "{}", json.dumps({"from": str(home), "run": 3}), "\x00"]
    lines.write_text("\n".join([*odd, lines.read_text()]))
    assert [files.path for files in runs_from_here()] == [Path("near")]
    lines.write_bytes(b"\xff")
    assert runs_from_here() == []
    lines.unlink()
    lines.mkdir()
    remember(Path("other"))
    monkeypatch.setattr(elsewhere, "user_zoo", lambda: Path("/proc/none/zoo"))
    remember(Path("other"))
    assert runs_from_here() == []
    (home / "gone").mkdir()
    monkeypatch.chdir(home / "gone")
    (home / "gone").rmdir()
    remember(Path("other"))
    assert runs_from_here() == []


@pytest.mark.parametrize(
    ("words", "start"),
    [
        (["eval", "runs/nothing"], "expected a run's folder with run.json, found none at"),
        (["eval", "nothing"], "unknown teacher 'nothing'"),
        (["transfer", "--resume", "runs/nothing"], "expected a run's folder with run.json"),
        (["compare", "runs/nothing"], "expected a run's folder with run.json, found none at"),
    ],
    ids=lambda x: "",
)
def test_a_run_that_is_not_there_leads_to_those_that_are(repaint, home, words, start):
    assert "newest" not in repaint(*words).err
    for n in range(7):
        pretend(Path(f"runs/reacher/run-{n}"), n)
    said = repaint(*words)
    assert said.code == NotFound.exit_code
    assert said.err.startswith(f"error: {start}")
    newest = ", ".join(f"runs/reacher/run-{n}" for n in (6, 5, 4, 3, 2))
    assert said.err.endswith(f"; the newest runs are {newest}\n")


def test_one_run_is_no_list(home):
    pretend(Path("runs/reacher/only"), 1)
    assert newest_named() == "; the newest run is runs/reacher/only"
