"""What else may happen to a run's folder before it goes on, and between any two of its files."""

import errno
import json
import shutil

import pytest
from small_runs import QUICK, QUICK_LAP, add_teacher, files_below
from test_resume import assert_same, rewritten
from test_runs import SCRATCH, record_of

from repaint_cli.errors import CardError, CheckpointError, StoreError, UsageError
from repaint_cli.files.lock import folder_lock
from repaint_cli.files.paths import shipped
from repaint_cli.policies.weights import load, save
from repaint_cli.runs import carry_out, checkpoint, experiment
from repaint_cli.zoo.teacher_card import read_card, read_summary

pytestmark = pytest.mark.usefixtures("unpainted")  # no picture of a run is looked at


def spoil(path):
    content = bytearray(path.read_bytes())
    content[-5] ^= 1
    path.write_bytes(content)


def stop(*_):
    raise KeyboardInterrupt


def test_a_fallback_keeps_the_checkpoint_that_it_stands_on(repaint, lay, home, monkeypatch):
    repaint(*SCRATCH, "--iterations", 3, "--keep", 2)
    lay(*SCRATCH, "--iterations", 4, "--run", "calm")
    spoil(home / "run" / "checkpoint.safetensors")
    with monkeypatch.context() as patch:  # dies as it writes the next
        patch.setattr(checkpoint, "save_learner", stop)
        assert repaint("transfer", "--resume", "run", "--iterations", 4).code == 130
    assert load(home / "run" / "checkpoint.safetensors")[1]["iteration"] == 2
    said = repaint("transfer", "--resume", "run", "--iterations", 4)
    assert said.code == 0
    assert "warning" not in said.out
    for path in (home / "run").glob("checkpoint-*"):
        path.unlink()
    rewritten(home / "calm" / "checkpoint.safetensors")
    record = record_of(home / "run") | {"keep": 1}
    (home / "run" / "run.json").write_text(json.dumps(record))
    assert_same(home / "run", home / "calm")


@pytest.mark.parametrize("at", ["save_checkpoint", "add"])
def test_the_best_policy_is_of_a_finished_iteration(repaint, lay, home, monkeypatch, at):
    where = experiment if at == "save_checkpoint" else carry_out.store
    real, calls = getattr(where, at), []

    def stopped(*args, **kwargs):
        calls.append(args)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return real(*args, **kwargs)

    with monkeypatch.context() as patch:
        patch.setattr(where, at, stopped)
        repaint(*SCRATCH, "--iterations", 6)
    done = load(home / "run" / "checkpoint.safetensors")[1]
    assert read_card(home / "run" / "best.safetensors").iteration == done["past"]["best"][0]
    repaint("transfer", "--resume", "run", "--iterations", 6)
    lay(*SCRATCH, "--iterations", 6, "--run", "calm")
    assert_same(home / "run", home / "calm")


def test_an_interruption_of_the_last_steps_says_how_to_finish(repaint, home, monkeypatch):
    monkeypatch.setattr(carry_out, "score", stop)
    said = repaint("train-teacher", "--task", "reacher", "--run", "run", *QUICK)
    assert said.code == 130
    command = "repaint train-teacher --resume run"
    assert said.out.splitlines()[-1] == f"not all is drawn and kept; next: {command}"


def test_a_file_system_without_locks_has_none(home, monkeypatch):
    def flock(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr("fcntl.flock", flock)
    with folder_lock(home), folder_lock(home):
        pass


def test_alarms_are_recorded_up_to_a_number(repaint, home, monkeypatch):
    monkeypatch.setattr("repaint_cli.runs.record.MOST_ALARMS", 3)
    add_teacher(home / "home" / "zoo")
    words = ["transfer", "--teacher", "old-hand", "--task", "reacher", "--run", "run", *QUICK]
    said = repaint(*words, "--threshold", 1e9, "--iterations", 10, "--transfer-iterations", 10)
    assert said.out.count("no teacher sample was kept") == 5
    assert len(record_of(home / "run")["alarms"]) == 3


def test_another_track_is_another_run(repaint, home):
    track = home / "mine.npy"
    shutil.copy(shipped("tasks") / "racer" / "tracks" / "oval.npy", track)
    words = ["transfer", "--method", "scratch", "--task", "racer-inner", "--run", "run"]
    assert repaint(*words, *QUICK_LAP, "--set", f"env.track={track}").code == 0
    shutil.copy(shipped("tasks") / "racer" / "tracks" / "reinvent-like.npy", track)
    said = repaint("transfer", "--resume", "run", "--iterations", 3)
    assert said.code == CheckpointError.exit_code
    assert "of another run than run.json beside it: track " in said.err


def test_other_versions_stay_on_record(repaint, lay, home):
    lay(*SCRATCH)
    record = record_of(home / "run")
    began = record["versions"] | {"torch": "1.0"}
    (home / "run" / "run.json").write_text(json.dumps(record | {"versions": began}))
    assert "torch 1.0 → " in repaint("transfer", "--resume", "run", "--iterations", 3).out
    assert "warning" not in repaint("transfer", "--resume", "run", "--iterations", 4).out
    record = record_of(home / "run")
    assert record["versions"] == began
    assert [later["after"] for later in record["resumed"]] == [2]


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"keep": "a"}, "keep: "),
        ({"keep": 0}, "keep: "),
        ({"versions": 3}, "with what it began"),
        ({"replace": None}, "replace: "),
    ],
)
def test_a_record_that_says_nonsense_is_refused(repaint, lay, home, changes, text):
    lay(*SCRATCH)
    record = record_of(home / "run") | changes
    (home / "run" / "run.json").write_text(json.dumps(record))
    said = repaint("transfer", "--resume", "run")
    assert said.code == CheckpointError.exit_code
    assert text in said.err
    assert said.err.count("\n") == 1


@pytest.mark.parametrize(
    "changes",
    [
        {"past": None},
        {"past": {"seconds": "x"}},
        {"iteration": "many"},
        {"env_steps": [1, 2]},
        {"env_steps": [10**30]},
    ],
)
def test_a_checkpoint_whose_notes_are_nonsense_is_refused(repaint, lay, home, changes):
    lay(*SCRATCH)
    rewritten(home / "run" / "checkpoint.safetensors", **changes)
    said = repaint("transfer", "--resume", "run", "--iterations", 3)
    assert said.code == CheckpointError.exit_code
    assert said.err.count("\n") == 1


def test_a_run_of_before_a_setting_was_there_goes_on(repaint, lay, home):
    lay(*SCRATCH)
    notes = load(home / "run" / "checkpoint.safetensors")[1]["run"]
    record = record_of(home / "run")
    for identity in (notes, record):
        del identity["task"]["net"]["mask"], identity["transfer"]["start"]
    rewritten(home / "run" / "checkpoint.safetensors", run=notes)
    (home / "run" / "run.json").write_text(json.dumps(record))
    said = repaint("transfer", "--resume", "run", "--iterations", 3)
    assert said.code == 0, said.err
    notes["task"]["net"]["hidden"] = [3]
    rewritten(home / "run" / "checkpoint.safetensors", run=notes)
    assert "task.net.hidden [3] against" in repaint("transfer", "--resume", "run").err


def test_files_that_are_not_the_run_s_are_left_alone(repaint, lay, home):
    lay(*SCRATCH)
    odd = [".my-notes", "evaluations/7.safetensors", "evaluations/notes.txt"]
    for name in odd:
        (home / "run" / name).write_text("mine")
    (home / "run" / ".repaint-abc.csv").write_text("half")
    (home / "run" / "evaluations" / "7.safetensors").unlink()
    assert repaint("transfer", "--resume", "run", "--iterations", 3).code == 0
    there = files_below(home / "run")
    assert there[".my-notes"] == there["evaluations/notes.txt"] == b"mine"
    assert ".repaint-abc.csv" not in there


def test_the_option_to_leave_out_is_named_as_it_is_typed(repaint, lay, home):
    lay(*SCRATCH)
    said = repaint("transfer", "--resume", "run", "--set", "ppo.gamma=0.9")
    assert said.code == UsageError.exit_code
    assert "leave out --set beside --resume" in said.err


def test_a_long_summary_is_no_damage(repaint, home):
    path = add_teacher(home / "home" / "zoo")
    tensors, card = load(path)
    card["task"]["summary"] = "long " * 20_000
    save(path, tensors, card)
    assert read_summary(path).task == "reacher"


@pytest.mark.parametrize("name", ["render_mode", "max_episode_steps"])
def test_what_is_gymnasium_s_own_is_no_argument_of_an_environment(repaint, home, name):
    (home / "mine.toml").write_text(f'extends = "reacher"\n[env.kwargs]\n{name} = "human"\n')
    said = repaint("tasks", "check", "mine.toml")
    assert said.code == CardError.exit_code
    assert f"expected arguments of the environment itself, found {name}" in said.err


def test_a_file_that_a_teacher_s_card_names_is_not_opened(repaint, home):
    path = add_teacher(home / "home" / "zoo")
    tensors, card = load(path)
    card["task"]["env"]["kwargs"] = {"xml_file": "/etc/passwd"}
    save(path, tensors, card)
    assert "the file /etc/passwd (xml_file) is never run" in repaint("zoo", "verify").out
    said = repaint("eval", "old-hand")
    assert said.code == CardError.exit_code
    assert "the file /etc/passwd (xml_file)" in said.err


def test_a_folder_that_cannot_be_read_is_named(repaint, home, monkeypatch):
    add_teacher(home / "home" / "zoo")

    def scandir(_):
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr("repaint_cli.zoo.store.os.scandir", scandir)
    said = repaint("zoo", "list")
    assert said.code == StoreError.exit_code
    assert said.err == f"error: cannot read {home}/home/zoo: Permission denied\n"


@pytest.mark.parametrize("spoiled", [False, True])
def test_a_name_that_is_taken_meanwhile_costs_no_policy(repaint, home, monkeypatch, spoiled):
    real, other = carry_out.score, home / "home" / "zoo" / "mine.safetensors"

    def score(*args):  # while it is measured, another gets the name
        add_teacher(other.parent, "mine")
        if spoiled:
            other.write_bytes(b"not whole")
        return real(*args)

    words = ["train-teacher", "--task", "reacher", "--name", "mine", "--run", "run", *QUICK]
    with monkeypatch.context() as patch:
        patch.setattr(carry_out, "score", score)
        said = repaint(*words)
    before = other.read_bytes()
    assert said.code == StoreError.exit_code
    assert f"{other} exists already; the policy is kept in run/best.safetensors" in said.err
    command = "repaint train-teacher --resume run"
    assert said.out.splitlines()[-1] == f"not all is drawn and kept; next: {command}"
    assert repaint(*command.split()[1:], "--name", "two").code == 0
    assert other.read_bytes() == before
    assert (other.parent / "two.safetensors").is_file()
