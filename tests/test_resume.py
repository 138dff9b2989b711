"""A run that was stopped, in whatever way, and goes on as if nothing had happened."""

import csv
import json
import signal
from pathlib import Path

import killed_runs
import pytest
from small_runs import QUICK, add_teacher, files_below
from test_runs import SCRATCH, record_of, stopped_by

from repaint_cli.errors import CheckpointError, NotFound, StoreError, TeacherMismatch, UsageError
from repaint_cli.files.atomic import sha256
from repaint_cli.files.lock import folder_lock
from repaint_cli.policies import weights
from repaint_cli.policies.weights import load
from repaint_cli.runs import carry_out, experiment
from repaint_cli.runs.figures import draw_run
from repaint_cli.runs.plan import plan_of
from repaint_cli.runs.reader import read_run

CLOCK = {"seconds", "steps_per_second", "tstamp", "wall_clock"}


def contents(folder):
    """All that a run has written, but for times of the clock."""
    tensors, notes = load(folder / "checkpoint.safetensors")
    del notes["past"]["seconds"]
    best, card = load(folder / "best.safetensors")
    draw_run(read_run(folder))
    logs = sorted((folder / "deepracer").rglob("TrainingMetrics.json"))
    left_out = ("seconds", "teachers", "attempt")
    record = {k: v for k, v in record_of(folder).items() if k not in left_out}
    for one in record["ranked"]:
        one["name"] = Path(one["name"]).name  # beside which folder they lie differs
        del one["seconds"]
    return {
        "tables": {str(p.relative_to(folder)): table(p) for p in sorted(folder.rglob("*.csv"))},
        "tensors": bits(tensors), "notes": notes, "best": bits(best),
        "which": (card["iteration"], card["seed"], card["env_steps"]),
        "record": record,
        "pictures": {path.name: path.read_bytes() for path in sorted(folder.glob("*.png"))},
        "logs": [path.read_text() for path in logs],
        "texts": [texts(path) for path in sorted(folder.rglob("*-robomaker.log"))],
        "files": {str(path.relative_to(folder)) for path in folder.rglob("*")},
    }  # fmt: skip


def table(path):
    with path.open(encoding="utf-8", newline="") as file:
        return [[v for name, v in row.items() if name not in CLOCK] for row in csv.DictReader(file)]


def texts(path):
    """The steps of a log as text, without the time of the clock at their ends."""
    return [line.rpartition(",")[0] for line in path.read_text().splitlines()]


def bits(tensors):
    return {name: tensor.numpy().tobytes() for name, tensor in tensors.items()}


def assert_same(folder, other):
    """Check what a run has written against another, or against its contents."""
    found, wanted = contents(folder), other if isinstance(other, dict) else contents(other)
    for name, value in wanted.items():
        assert found[name] == value, name


@pytest.mark.parametrize(
    ("kind", "kills"),
    [("repaint", 12), pytest.param("repaint", 50, marks=pytest.mark.slow), ("compiled", 4),
     ("auto", 4), ("relevance", 3), ("q-learning", 4), ("continued", 4), ("racer", 2),
     pytest.param("racer", 6, marks=pytest.mark.slow)],
)  # fmt: skip
def test_a_run_killed_again_and_again_ends_as_an_undisturbed_one(tmp_path, kind, kills):
    (tmp_path / "calm").mkdir()
    killed_runs.go_on(kind, tmp_path / "calm" / "run")
    calm = contents(tmp_path / "calm" / "run")
    deaths, fate, number = 0, 0, 0
    while deaths < kills:
        folder = tmp_path / f"wild-{number}" / "run"
        folder.parent.mkdir(exist_ok=True)
        if killed_runs.killed(kind, folder, fate):
            deaths += 1
        else:
            assert_same(folder, calm)
            number += 1
        fate += 1
    killed_runs.go_on(kind, folder)
    assert_same(folder, calm)


@pytest.mark.parametrize(
    ("kind", "share", "n_iterations"),
    [
        ("repaint", 0.5, 3),
        pytest.param("repaint", 0, 3, marks=pytest.mark.slow),
        pytest.param("repaint", 1, 3, marks=pytest.mark.slow),
        pytest.param("racer", 0.5, 2, marks=pytest.mark.slow),
    ],
)
def test_a_run_killed_in_any_append_ends_as_an_undisturbed_one(tmp_path, kind, share, n_iterations):
    (tmp_path / "calm").mkdir()
    killed_runs.go_on(kind, tmp_path / "calm" / "run", n_iterations)
    calm = contents(tmp_path / "calm" / "run")
    half_done, number = set(), 1
    while True:
        folder = tmp_path / f"wild-{number}" / "run"
        folder.parent.mkdir()
        if not killed_runs.killed_in_append(kind, folder, number, share, n_iterations):
            break
        half_done |= {
            path.name
            for path in folder.rglob("*")
            if path.suffix in (".csv", ".json", ".jsonl") and path.read_bytes()[-1:] != b"\n"
        }
        killed_runs.go_on(kind, folder, n_iterations)
        assert contents(folder) == calm
        number += 1
    wanted = {"repaint": set(), "racer": {"TrainingMetrics.json"}}[kind] | {"metrics.csv"}
    assert half_done == (wanted if share == 0.5 else set())
    assert number > (3 if kind == "repaint" else 7)


@pytest.mark.parametrize("kind", ["repaint", "q-learning", "continued"])
def test_more_iterations_are_those_of_a_longer_run(tmp_path, kind):
    for name, n_iterations in (("long", 5), ("short", 3)):  # with the same teacher beside them
        killed_runs.go_on(kind, tmp_path / name, n_iterations)
    short = read_run(tmp_path / "short")
    plan = plan_of(short.record, short.task, short.folder).for_iterations(5)
    list(experiment.Experiment.resume(plan).run())
    assert_same(plan.folder, tmp_path / "long")


def test_resume_from_the_command_line(repaint, lay, home):
    lay(*SCRATCH)
    lay(*SCRATCH, "--run", "long", "--iterations", 4)
    seconds = record_of(home / "run")["seconds"]
    said = repaint("transfer", "--resume", "run", "--iterations", 4)
    assert said.code == 0
    assert [line[:13] for line in said.out.splitlines()[:2]] == ["iteration 3/4", "iteration 4/4"]
    assert said.out.splitlines()[-1] == "next: repaint eval run --render-offscreen"
    assert_same(home / "run", home / "long")
    assert record_of(home / "run")["seconds"] >= seconds


def test_a_finished_run_is_finished_again(repaint, lay, home):
    lay(*SCRATCH)
    before = contents(home / "run")
    assert repaint("transfer", "--resume", "run").code == 0
    assert contents(home / "run") == before


def test_a_teacher_that_was_all_but_done(repaint, home, monkeypatch):
    words = ["train-teacher", "--task", "reacher", "--name", "mine", "--run", "run", *QUICK]

    def stopped(*args):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(carry_out, "score", stopped)
        assert repaint(*words).code == 130
    mine = home / "home" / "zoo" / "mine.safetensors"
    assert not mine.exists()
    assert repaint("train-teacher", "--resume", "run").code == 0
    first = mine.read_bytes()
    assert repaint("train-teacher", "--resume", "run").code == 0  # the very same may stay
    assert mine.read_bytes() == first
    said = repaint("train-teacher", "--resume", "run", "--iterations", 3)
    assert said.code == StoreError.exit_code
    assert "your zoo has a teacher 'mine' already" in said.err
    assert repaint("train-teacher", "--resume", "run", "--iterations", 3, "--name", "two").code == 0
    assert (home / "home" / "zoo" / "two.safetensors").is_file()


@pytest.mark.parametrize(
    ("words", "error", "text"),
    [
        (["transfer", "--resume", "run", "--beta", "3"], UsageError, "leave out --beta beside"),
        (["transfer", "--resume", "run", "--task", "ant"], UsageError, "leave out --task beside"),
        (["transfer", "--resume", "no"], NotFound, "expected a run's folder with run.json"),
        (["transfer", "--resume", "run", "--iterations", 1], UsageError,
         "of at least 2, which run"),
        (["train-teacher", "--resume", "run"], UsageError, "with: repaint transfer --resume run"),
        (["transfer"], UsageError, "expected --task NAME (repaint tasks list), or --resume RUN"),
    ],
)  # fmt: skip
def test_what_cannot_be_resumed_so(repaint, lay, home, words, error, text):
    lay(*SCRATCH)
    before = files_below(home / "run")
    said = repaint(*words)
    assert said.code == error.exit_code
    assert text in said.err
    assert said.err.count("\n") == 1
    assert files_below(home / "run") == before


def rewritten(path, **changes):
    tensors, header = load(path)
    weights.save(path, tensors, {**header, **changes})


def test_a_checkpoint_of_another_version_is_refused(repaint, lay, home):
    lay(*SCRATCH)
    rewritten(home / "run" / "checkpoint.safetensors", version="0.0.7")
    said = repaint("transfer", "--resume", "run")
    assert said.code == CheckpointError.exit_code
    assert "was written by repaint 0.0.7, this is repaint 0.2.0, which" in said.err


def test_a_checkpoint_of_another_run_is_refused(repaint, lay, home):
    lay(*SCRATCH)
    for other, name in (("--set=ppo.gamma=0.9", "gamma"), ("--task=reacher-away", "away")):
        lay(*SCRATCH, "--run", name, other)
        theirs = home / name / "checkpoint.safetensors"
        (home / "run" / "checkpoint.safetensors").write_bytes(theirs.read_bytes())
        said = repaint("transfer", "--resume", "run")
        assert said.code == CheckpointError.exit_code
        found = {
            "gamma": "task.ppo.gamma 0.9 against 0.99",
            "away": 'task.name "reacher-away" against "reacher"',
        }
        assert f"of another run than run.json beside it: {found[name]};" in said.err


def test_a_run_whose_teacher_is_another_now_is_refused(repaint, home):
    teacher = add_teacher(home / "home" / "zoo")
    words = ["transfer", "--teacher", "old-hand", "--task", "reacher", "--run", "run", *QUICK]
    repaint(*words)
    elsewhere = home / "elsewhere.safetensors"
    teacher.rename(elsewhere)
    said = repaint("transfer", "--resume", "run", "--iterations", 3)
    assert said.code == NotFound.exit_code
    assert f"the run's teacher 'old-hand' is gone: expected it at {teacher}" in said.err
    add_teacher(home / "home" / "zoo", iteration=2)
    said = repaint("transfer", "--resume", "run", "--iterations", 3)
    assert said.code == TeacherMismatch.exit_code
    theirs, ours = record_of(home / "run")["teachers"][0]["sha256"], sha256(teacher)
    assert f"was {theirs[:12]}… (sha256), {teacher} is {ours[:12]}…" in said.err
    elsewhere.replace(teacher)
    assert repaint("transfer", "--resume", "run", "--iterations", 3).code == 0


def test_earlier_checkpoints_are_kept_and_stand_in_for_a_damaged_one(repaint, lay, home):
    repaint(*SCRATCH, "--iterations", 5, "--keep", 3)
    lay(*SCRATCH, "--iterations", 5, "--run", "calm")
    kept = sorted(path.name for path in (home / "run").glob("checkpoint*"))
    assert kept == ["checkpoint-00003.safetensors", "checkpoint-00004.safetensors",
                    "checkpoint.safetensors"]  # fmt: skip
    damaged = home / "run" / "checkpoint.safetensors"
    content = bytearray(damaged.read_bytes())
    content[-5] ^= 1
    damaged.write_bytes(content)
    said = repaint("transfer", "--resume", "run")
    assert said.code == 0
    assert "warning: run/checkpoint.safetensors is not what was written" in said.out
    assert "going on from checkpoint-00004.safetensors" in said.out
    assert "iteration 5/5" in said.out
    assert bits(load(damaged)[0]) == bits(load(home / "calm" / "checkpoint.safetensors")[0])


def test_metrics_that_lack_an_iteration_are_no_runs(repaint, lay, home):
    lay(*SCRATCH)
    path = home / "run" / "metrics.csv"
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-1]))
    said = repaint("transfer", "--resume", "run")
    assert said.code == CheckpointError.exit_code
    assert "expected its line 3 to be of iteration 2, as the checkpoint" in said.err


def test_other_versions_are_said(repaint, lay, home):
    lay(*SCRATCH)
    record = record_of(home / "run")
    record["versions"]["torch"] = "1.0"
    (home / "run" / "run.json").write_text(json.dumps(record))
    said = repaint("transfer", "--resume", "run", "--iterations", 3)
    assert said.code == 0
    assert "warning: the run goes on with other versions (torch 1.0 → " in said.out


def test_of_two_processes_at_a_run_one_is_refused(repaint, lay, home):
    lay(*SCRATCH)
    before = files_below(home / "run")
    with folder_lock(home / "run"):
        said = repaint("transfer", "--resume", "run", "--iterations", 3)
    assert said.code == StoreError.exit_code
    assert "run is being written by another process" in said.err
    assert files_below(home / "run") == before
    assert repaint("transfer", "--resume", "run", "--iterations", 3).code == 0


def test_events_of_what_was_never_finished_are_void(repaint, home):
    pytest.importorskip("tensorboard")
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    repaint(*SCRATCH, "--tensorboard", "--iterations", 3, "--keep", 2)
    (home / "run" / "checkpoint.safetensors").unlink()  # as if killed in the third
    assert repaint("transfer", "--resume", "run", "--tensorboard").code == 0
    events = EventAccumulator(str(home / "run" / "tensorboard" / "seed-0")).Reload()
    assert [event.step for event in events.Scalars("eval_return")] == [1, 2, 3]


def test_a_scheduler_s_sigterm_ends_with_143_and_the_run_goes_on(repaint, lay, home):
    code, out, err = stopped_by(signal.SIGTERM, 400)
    assert (code, err) == (143, "")
    done = record_of(home / "run")["iterations"]
    assert out.endswith(
        f"interrupted after iteration {done}\nnext: repaint transfer --resume run\n"
    )
    assert repaint("transfer", "--resume", "run", "--iterations", done + 1).code == 0
    lay(*SCRATCH, "--run", "calm", "--iterations", done + 1)
    assert_same(home / "run", home / "calm")
