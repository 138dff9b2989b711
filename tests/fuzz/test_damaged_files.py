"""Files that nobody wrote in good faith: a line and an exit code, no traceback, no code run.

Thousands of spoiled files are read in a process of its own, see read_damaged_files.py; what chance
would hardly find is written out here.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import read_damaged_files
from read_damaged_files import Reading
from read_targets import Target
from small_runs import add_teacher

from repaint_cli.envs.racer.deepracer.simtrace_reader import read_training
from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.errors import CardError, CheckpointError, RepaintError, reported_as
from repaint_cli.files.limits import read_bytes
from repaint_cli.files.paths import PACKAGE
from repaint_cli.runs.reader import read_run
from repaint_cli.tasks.card_files import read_task
from repaint_cli.zoo import store

HUGE = 8 * 2**30
"""Bytes of a file that must not be read in; it has a hole for most of them."""
FAST, THOROUGH = 500, 20_000
"""Spoiled files."""


def many(n_cases):
    """Read so many spoiled files elsewhere."""
    program = Path(read_damaged_files.__file__)
    paths = os.pathsep.join([str(PACKAGE.parent), *filter(None, sys.path)])
    done = subprocess.run(
        [sys.executable, str(program), str(n_cases)],
        env=os.environ | {"PYTHONPATH": paths, "OMP_NUM_THREADS": "1"},
        capture_output=True, text=True, timeout=60 + n_cases / 20, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    result = json.loads(done.stdout)
    assert result["failures"] == []
    assert result["cases"] >= n_cases
    assert not result["ran"]
    assert (
        min(result["read"], result["refused"]) > n_cases / 20
    )  # neither all harmless nor all broken
    assert result["grown"] < read_damaged_files.MEMORY
    return result


def test_spoiled_files_are_read_or_refused_in_a_line():
    many(FAST)


@pytest.mark.slow
def test_very_many_spoiled_files_are_read_or_refused_in_a_line():
    many(THOROUGH)


def test_the_judge_sees_what_must_not_be(tmp_path):
    path = tmp_path / "file"
    path.write_text("x")

    def judged(read):
        reading = Reading()
        reading.case("it", Target(path, read, None), b"x")
        return "".join(reading.failures)

    assert judged(path.read_text) == ""
    assert "ZeroDivisionError" in judged(lambda: 1 / 0)
    assert "os.system (b'true',)" in judged(lambda: os.system("true"))
    assert "exec (<code object <module> at" in judged(lambda: exec("1", {}))
    assert "compile" in judged(lambda: compile("1", "evil.py", "exec"))
    assert "open (" in judged(lambda: (tmp_path / "other").write_text("y"))
    assert "bytes of memory" in judged(lambda: np.ones(2**25))


# ---- anything in place of a file ----


def load(kind, path):
    """Read a file as each of the readers does."""
    readers = {
        "teacher.safetensors": store.read_teacher,
        "card.toml": lambda path: read_task(str(path)),
        "track.npy": lambda path: load_track(str(path)),
        "run.json": lambda path: read_run(path.parent),
        "metrics.csv": lambda path: read_run(path.parent),
        "0-iteration.csv": lambda path: list(read_training(path.parents[1])),
        "model_metadata.json": lambda path: read_task(str(path.parent / "card.toml")),
        "hyperparameters.json": lambda path: read_task(str(path.parent / "card.toml")),
        "reward.py": lambda path: read_task(str(path.parent / "card.toml")),
    }
    return readers[kind](path)


RECORD = {"schema_version": 2, "method": "scratch", "teachers": [], "seeds": [0]}
HEAD = "iteration,seed,eval_return,eval_progress,env_steps,kickstart_coef,kept_fraction,seconds"
SECTIONS = {
    "model_metadata.json": '[env]\nmodel_metadata = "model_metadata.json"',
    "hyperparameters.json": '[ppo]\nhyperparameters = "hyperparameters.json"',
    "reward.py": '[reward]\nfunction = "reward.py"',
}
KINDS = [
    "teacher.safetensors", "card.toml", "track.npy", "run.json", "metrics.csv", "0-iteration.csv",
    *SECTIONS,
]  # fmt: skip


def record(**changes):
    return json.dumps(RECORD | {"task": read_task("reacher").model_dump(mode="json")} | changes)


@pytest.fixture(params=KINDS)
def place(request, tmp_path):
    """Where a file of a kind lies, with what it needs beside it."""
    kind = request.param
    (tmp_path / "training-simtrace").mkdir()
    if kind == "metrics.csv":
        (tmp_path / "run.json").write_text(record())
    if kind in SECTIONS:
        card = f'extends = "racer-inner"\nsummary = "x"\n{SECTIONS[kind]}\n'
        (tmp_path / "card.toml").write_text(card)
    folder = tmp_path / "training-simtrace" if kind == "0-iteration.csv" else tmp_path
    return folder / kind


def refused(place, message):
    load_track("oval")  # whose simulator is imported now, unwatched
    reading = Reading()
    with reading.watched(place.name, b""), pytest.raises(RepaintError, match=message):
        load(place.name, place)
    assert reading.failures == []


NO_FILE = "expected a regular file, found something else"


def test_a_pipe_is_not_waited_for(place):
    os.mkfifo(place)
    refused(place, NO_FILE)


def test_a_folder_is_no_file(place):
    place.mkdir()
    refused(place, NO_FILE)


def test_an_endless_file_is_not_begun(place):
    place.symlink_to("/dev/zero")
    refused(place, NO_FILE)


def test_links_in_a_circle_are_noticed(place):
    place.symlink_to(place.parent / "other")
    (place.parent / "other").symlink_to(place)
    if place.name == "0-iteration.csv":  # is found by looking into its folder, not by its name
        return refused(place, "Too many levels of symbolic links")
    refused(place, "Too many levels of symbolic links|found none|there is no card")


def test_eight_gigabytes_of_nothing_are_not_read_in(place):
    place.touch()
    os.truncate(place, HUGE)
    refused(place, "expected at most [0-9,]+ bytes, found 8,589,934,592|not a whole safetensors")


def test_eight_gigabytes_behind_a_teacher_are_not_read_in(tmp_path):
    path = add_teacher(tmp_path)
    os.truncate(path, HUGE)
    with pytest.raises(CheckpointError, match="is not a whole safetensors file"):
        store.read_teacher(path)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_file_that_may_not_be_read_is_named(place):
    place.touch(mode=0)
    refused(place, "Permission denied")


def test_bytes_that_are_no_utf_8_are_refused(place):
    place.write_bytes(b"\xff\xfe" * 40)
    refused(place, "expected UTF-8|can't decode|not a whole safetensors|as numpy.save writes it")


def test_an_empty_file_is_refused(place):
    place.touch()
    if place.name == "reward.py":  # which is read, and not run, before there is an environment
        assert load(place.name, place).reward_code.source == ""
        return
    refused(place, "expected|not a whole|Expecting value|required")


def test_a_file_is_read_up_to_its_limit_and_no_further(tmp_path, monkeypatch):
    (tmp_path / "x").write_bytes(b"12345")
    assert read_bytes(tmp_path / "x", 5) == b"12345"
    with (
        pytest.raises(CardError, match="expected at most 4 bytes, found 5"),
        reported_as(CardError),
    ):
        read_bytes(tmp_path / "x", 4)
    monkeypatch.setattr("repaint_cli.files.limits.check_file", lambda *_: None)  # it grew meanwhile
    with (
        pytest.raises(CardError, match="expected at most 4 bytes, found 5"),
        reported_as(CardError),
    ):
        read_bytes(tmp_path / "x", 4)
