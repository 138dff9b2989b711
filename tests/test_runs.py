"""Run folders: what is in them, and what remains when a run does not end well."""

import csv
import json
import os
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.spaces import Box
from small_runs import QUICK, QUICK_LAP, add_teacher, files_below, weights_of

from repaint_cli.errors import CardError, CheckpointError, DivergedError, NotFound
from repaint_cli.files.atomic import sha256
from repaint_cli.learn.evaluation import spaces_of
from repaint_cli.learn.update.adam import RowAdam
from repaint_cli.learn.update.compiled import update as compiled
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.weights import load
from repaint_cli.runs import checkpoint, experiment
from repaint_cli.runs.checkpoint import load_networks
from repaint_cli.runs.metrics import COLUMNS
from repaint_cli.runs.owner import new_run
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.reader import newest_run, read_run
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.card_files import read_task
from repaint_cli.tasks.card_text import to_toml
from repaint_cli.zoo.teacher_card import read_card
from repaint_cli.zoo.view_names import TeacherFile

SCRATCH = ["transfer", "--method", "scratch", "--task", "reacher", "--run", "run", *QUICK]
ALWAYS = {
    "run.json", "metrics.csv", "checkpoint.safetensors", "best.safetensors",
    "curves.png", "trajectories.png", "evaluations", "report.html",
}  # fmt: skip


def rows_of(folder):
    with (folder / "metrics.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def record_of(folder):
    return json.loads((folder / "run.json").read_text(encoding="utf-8"))


def written(said):
    """Every file that the last lines name."""
    lines = [line for line in said.out.splitlines() if line.startswith("wrote ")]
    pairs = [line.removeprefix("wrote ").split("/: ") for line in lines]
    return {Path(folder) / name for folder, names in pairs for name in names.split(", ")}


def test_a_transfer_writes_all_it_says_and_says_all_it_writes(repaint, home):
    teacher = add_teacher(home / "home" / "zoo", task="reacher-gentle")
    said = repaint(
        "transfer", "--teacher", "old-hand", "--task", "reacher", "--seeds", 2, "--seed", 5, *QUICK,
        "--method", "repaint",
    )  # fmt: skip
    (folder,) = (home / "runs" / "reacher").iterdir()
    assert folder.name.startswith("repaint-old-hand-20")
    assert said.code == 0
    assert {path.name for path in folder.iterdir()} == ALWAYS | {
        "seed-5.safetensors", "seed-6.safetensors"
    }  # fmt: skip
    assert {home / path for path in written(said)} == set(folder.iterdir())
    folder = folder.relative_to(home)
    assert said.out.splitlines()[-1] == f"next: repaint eval {folder} --render-offscreen"

    record = record_of(folder)
    assert record["teachers"] == [
        {
            "name": "old-hand",
            "view": "",
            "sha256": sha256(teacher),
            "instances": True,
            "file": str(teacher),
        }
    ]
    assert record["seeds"] == [5, 6]
    assert (record["state"], record["iterations"]) == ("finished", 2)
    assert record["versions"]["torch"] == torch.__version__
    assert TaskCard.parse(record["task"], "run.json").ppo.n_steps == 204
    assert record["transfer"]["instance"] == 1

    rows = rows_of(folder)
    assert tuple(rows[0]) == COLUMNS
    recorded = [(row["iteration"], row["seed"], row["phase"]) for row in rows]
    assert recorded == [
        ("1", "5", "representation"), ("1", "6", "representation"),
        ("2", "5", "instance"), ("2", "6", "instance"),
    ]  # fmt: skip
    assert [row["env_steps"] for row in rows] == ["204", "204", "408", "408"]
    assert all(row["eval_return"] and row["seconds"] and row["entropy"] for row in rows[:2])
    assert all(row["kept_fraction"] and not row["value_loss"] for row in rows[2:])
    assert not any(row["eval_progress"] for row in rows)


def test_the_racer_has_progress(repaint, home):
    said = repaint(
        "transfer", "--method", "scratch", "--task", "racer-inner", "--run", "run", *QUICK_LAP
    )
    assert said.code == 0
    assert {path.name for path in (home / "run").iterdir()} == ALWAYS | {
        "seed-0.safetensors", "heatmap.png", "progress.png", "deepracer",
    }  # fmt: skip
    assert all(float(row["eval_progress"]) >= 0 for row in rows_of(home / "run"))
    assert "progress" in said.out


def test_train_teacher_keeps_the_best_evaluated_policy_with_its_score(repaint, home):
    said = repaint("train-teacher", "--task", "reacher", "--name", "mine", "--seeds", 2, *QUICK)
    assert said.code == 0
    path = home / "home" / "zoo" / "mine.safetensors"
    assert path in written(said)
    assert "next: repaint eval mine --render-offscreen" in said.out
    (folder,) = (home / "runs" / "reacher").iterdir()
    best = max(rows_of(folder), key=lambda row: float(row["eval_return"]))
    card = read_card(path)
    assert (str(card.iteration), str(card.seed)) == (best["iteration"], best["seed"])
    assert str(card.env_steps) == best["env_steps"]
    assert card.score.episodes == 100
    assert card.score.low < card.score.mean < card.score.high
    assert card.parents == ()


def test_a_students_file_names_its_teachers_hash_and_is_a_teacher(repaint, home):
    teacher = add_teacher(home / "home" / "zoo")
    repaint("transfer", "--teacher", "old-hand", "--task", "reacher", "--run", "run", *QUICK)
    student = home / "run" / "seed-0.safetensors"
    assert read_card(student).parents == (sha256(teacher),)
    said = repaint("transfer", "--teacher", student, "--task", "reacher", "--run", "next", *QUICK)
    assert said.code == 0


def test_an_interruption_before_the_first_iteration_is_on_record(home, monkeypatch):
    path = add_teacher(home / "home" / "zoo")
    card = read_task("reacher").with_settings(["eval.episodes=2"])

    def interrupt(*args):
        raise KeyboardInterrupt

    monkeypatch.setitem(experiment.TRAINERS, "ppo", interrupt)
    plan = Plan(card, "repaint", [0], home / "run", (TeacherFile(path),))
    with pytest.raises(KeyboardInterrupt), new_run(plan) as run:
        next(run.run())
    assert record_of(home / "run")["state"] == "interrupted"


def test_tensorboard_gets_the_same_numbers(repaint, home):
    pytest.importorskip("tensorboard")
    assert repaint(*SCRATCH, "--tensorboard").code == 0
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    events = EventAccumulator(str(home / "run" / "tensorboard" / "seed-0")).Reload()
    for name in ("eval_return", "value_loss"):
        recorded = [scalar.value for scalar in events.Scalars(name)]
        assert recorded == pytest.approx(
            [float(row[name]) for row in rows_of(home / "run")], rel=1e-5
        )


def test_a_run_can_be_read_again(repaint, lay, home):
    lay(*SCRATCH)
    run = read_run(home / "run")
    assert (run.method, run.label, run.progress) == ("scratch", "scratch", None)
    assert run.returns.shape == (1, 2)
    assert run.returns[0] == pytest.approx([float(r["eval_return"]) for r in rows_of(run.folder)])


def test_the_newest_run_is_the_one_written_last(home):
    for n, name in enumerate(["b", "a", "empty"]):
        folder = home / "runs" / "reacher" / name
        folder.mkdir(parents=True)
        for file in ("run.json", "metrics.csv", "checkpoint.safetensors")[: 2 if n == 2 else 3]:
            (folder / file).touch()
        os.utime(folder / "metrics.csv", (n, n))
    assert newest_run(home / "runs").name == "a"
    with pytest.raises(NotFound, match="expected a run below nowhere/, found none; train: repaint"):
        newest_run(Path("nowhere"))


DAMAGES = [
    ("run.json", "{"),
    ("run.json", "[]"),
    ("run.json", '{"task": 1}'),
    ("metrics.csv", "iteration,seed\n1,0\n"),
    ("metrics.csv", "iteration,seed,eval_return\n1,0,x\n"),
    ("metrics.csv", ""),
]


def test_a_damaged_run_is_refused(repaint, lay, home):
    lay(*SCRATCH)
    for file, text in DAMAGES:
        whole = (home / "run" / file).read_text()
        (home / "run" / file).write_text(text)
        with pytest.raises((CheckpointError, CardError), match="run"):
            read_run(home / "run")
        (home / "run" / file).write_text(whole)
    assert read_run(home / "run")


def same_policies(folder):
    """Whether a run's policies and its checkpoint are the same ones."""
    task = read_run(folder).task
    network = ActorCritic(spaces_of(task), task.net, 1)
    load_networks(folder / "checkpoint.safetensors", network)
    policies = weights_of(folder / "seed-0.safetensors")
    return all(torch.equal(policies[name], leaf) for name, leaf in network.weights.items())


@pytest.mark.parametrize("during", ["evaluate", "append_csv"])
def test_ctrl_c_keeps_the_last_finished_iteration(repaint, home, monkeypatch, during):
    calls, real = [], getattr(experiment, during)

    def stopped(*args, **kwargs):
        calls.append(args)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return real(*args, **kwargs)

    monkeypatch.setattr(experiment, during, stopped)
    said = repaint(*SCRATCH, "--iterations", 5)
    assert said.code == 130
    assert "interrupted after iteration 2" in said.out
    assert {home / path for path in written(said)} == set((home / "run").iterdir())
    assert said.out.splitlines()[-1] == "next: repaint transfer --resume run"
    assert said.err == ""
    assert load(home / "run" / "checkpoint.safetensors")[1]["iteration"] in (2, 3)
    assert (record_of(home / "run")["state"], len(rows_of(home / "run"))) == ("interrupted", 2)
    assert same_policies(home / "run")


def test_ctrl_c_before_the_first_iteration_ends_says_so(repaint, home, monkeypatch):
    def stopped(*args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(experiment, "evaluate", stopped)
    said = repaint(*SCRATCH)
    assert (said.code, said.err) == (130, "")
    assert "interrupted after iteration 0" in said.out
    assert record_of(home / "run")["iterations"] == 0


def stopped_by(number, iterations):
    """Send a signal to a process after its third iteration; return how it ended."""
    words = [*map(str, SCRATCH), "--iterations", str(iterations)]
    with subprocess.Popen(
        [sys.executable, "-m", "repaint_cli", *words], text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=os.environ | {"OMP_NUM_THREADS": "1"},
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),  # not as in `test &`
    ) as process:  # fmt: skip
        for line in process.stdout:
            if line.startswith("iteration 3/"):
                process.send_signal(number)
                break
        out, err = process.communicate(timeout=60)
    return process.returncode, out, err


def test_a_real_ctrl_c_ends_a_real_process(home):
    code, out, err = stopped_by(signal.SIGINT, 100_000)
    assert (code, err) == (130, "")
    assert "wrote run/: run.json, metrics.csv, checkpoint.safetensors, best.safetensors" in out
    assert load(home / "run" / "checkpoint.safetensors")[1]["iteration"] >= 3
    assert same_policies(home / "run")


class Fragile(gymnasium.Env):
    """Breaks after some steps of the whole process."""

    observation_space = Box(-1.0, 1.0, (2,), np.float64)
    action_space = Box(-1.0, 1.0, (1,), np.float64)
    steps = 0
    breaks_at = 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self.np_random.uniform(-1, 1, 2), {}

    def step(self, action):
        type(self).steps += 1
        seen = self.np_random.uniform(-1, 1, 2)
        if self.steps > self.breaks_at:
            seen[1] = np.nan
        return seen, seen[0], False, False, {"pay": seen[0]}


gymnasium.register("repaint-tests/Fragile-v0", Fragile, max_episode_steps=5)


@pytest.fixture
def fragile(home):
    env = {"simulator": "gymnasium", "id": "repaint-tests/Fragile-v0"}
    ppo = {"n_iterations": 9, "n_steps": 12, "n_envs": 2, "n_epochs": 1}
    data = {"name": "fragile", "summary": "", "env": env, "reward": {"pay": 1.0}, "ppo": ppo}
    (home / "fragile.toml").write_text(to_toml(TaskCard.parse(data, "a test")))
    return ["transfer", "--task", "fragile.toml", "--method", "scratch", "--run", "run",
            "--eval-episodes", 1]  # fmt: skip


def test_an_environment_that_breaks_stops_the_run_at_once(repaint, home, fragile, monkeypatch):
    monkeypatch.setattr(Fragile, "steps", 0)
    monkeypatch.setattr(Fragile, "breaks_at", 60)
    said = repaint(*fragile)
    assert said.code == DivergedError.exit_code
    assert said.err.count("\n") == 1
    assert "observation that is not, in environment" in said.err
    rows = rows_of(home / "run")
    assert 1 <= len(rows) < 9
    tensors, header = load(home / "run" / "checkpoint.safetensors")
    assert header["iteration"] == len(rows)
    assert record_of(home / "run")["iterations"] == len(rows)
    assert tensors


@pytest.fixture(params=["plain", "compiled"])
def leaping(request, monkeypatch):
    """Let the third iteration's steps be far too long; return the setting of a run for it."""
    calls, step, view = [], RowAdam.step, compiled.adam_view

    def leap(self, policies, critics, scale, *longest):
        calls.append(scale)
        scale = 1e38 if len(calls) > 10 else scale  # 4 an iteration
        step(self, policies, critics, scale, *longest)

    def leaping_view(student, optimizer, s, tower, *others):
        calls.append(tower)
        whole = view(student, optimizer, s, tower, *others)
        return whole._replace(learning_rate=1e38) if len(calls) > 4 else whole  # 2 an iteration

    monkeypatch.setattr(RowAdam, "step", leap)
    monkeypatch.setattr(compiled, "adam_view", leaping_view)
    return "--set", f"ppo.compiled={str(request.param == 'compiled').lower()}"


def test_weights_that_diverge_stop_the_run_and_keep_the_last_good_checkpoint(
    repaint, home, leaping
):
    said = repaint(*SCRATCH, "--iterations", 5, *leaping)
    assert said.code == DivergedError.exit_code
    assert said.err.startswith("error: iteration 3, seed 0: expected")
    assert "a smaller ppo.learning_rate" in said.err
    assert said.err.count("\n") == 1
    assert load(home / "run" / "checkpoint.safetensors")[1]["iteration"] == 2
    assert (record_of(home / "run")["iterations"], len(rows_of(home / "run"))) == (2, 2)


def test_a_checkpoint_that_cannot_be_written_leaves_the_last_one(repaint, home, monkeypatch):
    real, before = checkpoint.save_learner, {}

    def fails_the_second_time(path, *rest):
        if path.exists():
            before.update(files_below(path.parent))
            monkeypatch.setattr("repaint_cli.files.atomic.os.fsync", no_space)
        real(path, *rest)

    def no_space(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(checkpoint, "save_learner", fails_the_second_time)
    said = repaint(*SCRATCH)
    assert said.code == 7
    assert said.err.startswith("error: cannot write run/")
    assert said.err.endswith("No space left on device\n")
    assert said.out.endswith("next: repaint transfer --resume run\n")
    after = files_below(home / "run")
    assert len(rows_of(home / "run")) == 1  # as many as the checkpoint has iterations
    changed = {name for name in before.keys() | after if before.get(name) != after.get(name)}
    assert changed == {"metrics.csv", "evaluations/00002.safetensors", "run.lock"}


def test_a_missing_checkpoint_is_named(repaint, lay, home):
    lay(*SCRATCH)
    (home / "run" / "checkpoint.safetensors").unlink()
    said = repaint("eval", "run")
    assert said.code == CheckpointError.exit_code
    assert "expected a safetensors file at run/checkpoint.safetensors, found none" in said.err


def test_two_runs_of_a_seed_are_the_same_run(repaint, home):
    for name in ("one", "two"):
        repaint(*SCRATCH, "--run", name)
    one, two = (weights_of(home / name / "seed-0.safetensors") for name in ("one", "two"))
    assert all(torch.equal(one[name], two[name]) for name in one)
    assert read_task("reacher").ppo.n_steps == 2048  # a run changes no card
