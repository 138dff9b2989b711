"""The commands on a page: typed again, they begin the same run."""

import json
import shlex
from pathlib import Path

import pytest
from small_runs import QUICK, add_teacher
from written_runs import climb, write_run

from repaint_cli.files.atomic import sha256
from repaint_cli.runs.reader import read_run
from repaint_cli.runs.record_parts import TeacherRecord
from repaint_cli.runs.run_command import command_of, compare_command
from repaint_cli.zoo.store import shipped_file

JOINED = "\\\n"
"""Where a shell reads on in the next line."""

DECIDED = ("method", "algorithm", "seeds", "task", "teacher_name")


def decided(folder):
    """What a run was begun with."""
    record = json.loads((folder / "run.json").read_text())
    teachers = [(teacher["name"], teacher["instances"]) for teacher in record["teachers"]]
    return [record[name] for name in DECIDED] + teachers


TAUGHT = [
    *("--teacher", "old-hand", "--teacher", "other", "--instances-from", "other"),
    *("--method", "instance", "--set", "select.rule=abs"),
]


@pytest.mark.parametrize(
    "words",
    [
        ["train-teacher", "--seed", 3, "--seeds", 2, "--name", "mine", "--set", "net.hidden=[8]"],
        ["transfer", *TAUGHT],
    ],
)
def test_the_command_of_a_run_begins_the_same_run(repaint, home, words):
    for name in ("old-hand", "other"):
        add_teacher(home / "home" / "zoo", name)
    assert repaint(*words, "--task", "reacher", *QUICK, "--run", "one").code == 0
    run = read_run(home / "one")
    typed = shlex.split(command_of(run.record, run.task).replace(JOINED, ""))
    assert typed[:2] == ["repaint", words[0]]
    replace = ["--replace"] if words[0] == "train-teacher" else []
    assert repaint(*typed[1:], *replace, "--run", "two").code == 0
    assert decided(home / "two") == decided(home / "one")


def test_a_teacher_is_named_by_what_its_file_holds_and_not_by_who_has_its_name_now(home):
    run = write_run(home / "run", climb())
    shipped = shipped_file("reacher-gentle")
    taught = {"name": "reacher-gentle", "sha256": sha256(shipped), "file": str(shipped)}
    record = run.record.model_copy(update={"teachers": [TeacherRecord(**taught)]})
    assert "--teacher reacher-gentle" in command_of(record, run.task).replace(JOINED, "")
    own = add_teacher(home / "home" / "zoo", "reacher-gentle")
    assert "--teacher reacher-gentle@shipped" in command_of(record, run.task).replace(JOINED, "")
    taught |= {"sha256": "of another file", "file": "runs/a/best.safetensors"}
    record = run.record.model_copy(update={"teachers": [TeacherRecord(**taught)]})
    assert "--teacher runs/a/best.safetensors" in command_of(record, run.task)
    assert own.is_file()


def test_a_card_of_ones_own_is_named_as_a_file(home):
    run = write_run(home / "run", climb(), name="my task")
    assert command_of(run.record, run.task) == (
        "repaint transfer --task 'my task.toml' --method scratch --seeds 3"
    )


def test_long_commands_break_before_options(home):
    settings = [f"ppo.{name}=0.5" for name in ("gamma", "gae_lambda", "clip_range", "kl_coef")]
    run = write_run(home / "run", climb(), settings=settings)
    text = command_of(run.record, run.task)
    assert max(map(len, text.splitlines())) <= 80
    assert all(line.startswith("    --set ppo.") for line in text.splitlines()[1:])
    assert shlex.split(text.replace(JOINED, ""))[-1] == "ppo.kl_coef=0.5"


def test_no_path_is_taken_for_an_option():
    text = compare_command([Path("-a"), Path("b c")], Path("-a"), [-4.5], Path("-r"))
    assert text == "repaint compare ./-a 'b c' --reference ./-a --target=-4.5 --report ./-r"
