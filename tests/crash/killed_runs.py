"""Runs in processes that are killed: at a moment from outside, or by themselves in mid-write."""

import multiprocessing
import os
import random
import signal
import sys
from functools import cache
from multiprocessing import forkserver
from pathlib import Path
from time import sleep

import pytest
import small_tasks
import torch
from small_learners import trained

from repaint_cli.files import atomic
from repaint_cli.files.provenance import versions
from repaint_cli.runs.owner import new_run, resumed_run
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.with_teachers import with_measured
from repaint_cli.tasks.card_files import read_task
from repaint_cli.zoo import store
from repaint_cli.zoo.teacher_card import TeacherCard
from repaint_cli.zoo.view_names import TeacherFile

AS_WRITTEN = "ppo.compiled=false"  # compiled code takes a while to load
AUTO = (
    "transfer.phases=auto", "transfer.kickstart_schedule=auto", "select.rule=auto",
    "transfer.iterations=12", "ppo.learning_rate=0.01",
)  # fmt: skip
LAP = (
    "env.max_steps=6", "ppo.n_episodes=3", "ppo.n_epochs=1", "net.conv=[[4,8,8]]", "net.dense=8"
)  # fmt: skip
NOISY = "ppo.learning_rate=0.1"  # whose best policy is not its last
RUNS = {
    "repaint": ("reach", "repaint", "ppo", (AS_WRITTEN, NOISY, "select.scale=student-batch")),
    "compiled": ("reach", "kickstart", "ppo", ()),
    "auto": ("reach", "repaint", "ppo", (AS_WRITTEN, *AUTO)),
    "relevance": ("reach", "instance", "ppo", (AS_WRITTEN, "select.rule=rbt")),
    "rewards": ("reach", "repaint", "ppo", (AS_WRITTEN, "ppo.normalize_rewards=true")),
    "fewer": ("guess", "repaint", "ppo", (AS_WRITTEN, "ppo.max_steps=30", "ppo.n_episodes=9")),
    "continued": ("reach", "repaint", "ppo", (AS_WRITTEN, "ppo.n_steps=20")),
    "racer": ("racer-inner", "scratch", "ppo", LAP),
    "q-learning": (
        "guess", "instance", "q-learning",
        ("q_learning.gradient_steps=20", "q_learning.memory=200"),
    ),
}  # fmt: skip
"""Kinds of runs that differ in what has to be restored: task, method, algorithm, settings."""


def plan(kind, folder, n_iterations=12):
    """A run of a moment, with a teacher beside it."""
    name, method, algorithm, settings = RUNS[kind]
    task = read_task(name) if kind == "racer" else getattr(small_tasks, name)()
    task = task.with_settings([*settings, f"ppo.n_iterations={n_iterations}", "eval.episodes=3"])
    teachers = () if method == "scratch" else (TeacherFile(add_teacher(task, folder.parent)),)
    return with_measured(Plan(task, method, [3, 5], folder, teachers, None, algorithm))


def add_teacher(task, folder):
    """A teacher that has learned the task."""
    path = folder / "old-hand.safetensors"
    if path.exists():
        return path
    card_to_learn = getattr(small_tasks, task.name)(n_iterations=12, learning_rate=0.02)
    learner, _ = trained(card_to_learn, seeds=[7], instance=0)
    spaces = learner.student.spaces
    card = TeacherCard(
        name="old-hand", task=task, obs_shape=spaces.obs_shape, n_actions=spaces.n_actions,
        discrete=spaces.discrete, method="scratch", seed=0, iteration=1, env_steps=10,
        versions=versions(), created="2021-07-18T00:00:00+00:00",
    )  # fmt: skip
    return store.add(learner.student, 0, card, folder)


def go_on(kind, folder, n_iterations=12):
    """Begin a run, or go on with it, to its end."""
    torch.set_num_threads(1)
    begun = (folder / "run.json").is_file()
    owned = resumed_run(folder) if begun else new_run(plan(kind, folder, n_iterations))
    with owned as experiment:
        for _ in experiment.run():
            pass


real_append = os.write


def _kill_self(*_, **__):
    os.kill(os.getpid(), signal.SIGKILL)


def _run_until_killed(kind, folder, case):
    """Go on with a run and kill it before, after or in a file operation that `case` decides."""
    rng = random.Random(case)
    left = [rng.randint(1, 150 if kind == "racer" else 45)]

    def killable(operation):
        def carried_out(*args, **kwargs):
            left[0] -= 1
            if left[0] == 0 and rng.random() < 0.5:
                _kill_self()
            if left[0] == 0 and operation is real_append:
                _append_and_kill_self(*args, rng.choice((0.5, 1)))
            done = operation(*args, **kwargs)
            if left[0] == 0:
                if operation is real_write:
                    os.truncate(args[0], os.path.getsize(args[0]) // 2)
                _kill_self()
            return done

        return carried_out

    real_write = Path.write_bytes
    Path.write_bytes = killable(real_write)
    names = "write fsync fdatasync replace rename truncate ftruncate unlink"
    for name in names.split():
        setattr(atomic.os, name, killable(getattr(os, name)))
    go_on(kind, folder)


def _append_and_kill_self(handle, data, share):
    """Write a part of what is to be appended, and have it on disk."""
    real_append(handle, data[: round(len(data) * share)])
    _kill_self()


def _run_until_killed_in_append(kind, folder, number, share, n_iterations):
    """Go on with a run and die in its `number`th append, of which a share is on disk."""
    left = [number]

    def append(handle, data):
        left[0] -= 1
        return real_append(handle, data) if left[0] else _append_and_kill_self(handle, data, share)

    atomic.os.write = append
    go_on(kind, folder, n_iterations)


@cache
def process_context():
    """The context of new processes, whose server has imported all they need."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["killed_runs"])
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", os.pathsep.join(filter(None, sys.path)))
        forkserver.ensure_running()
    return context


def killed(kind, folder, case):
    """Go on with a run until it is killed, or its end; return whether it was killed."""
    if not case % 2:
        return _ended(
            process_context().Process(target=_run_until_killed, args=(kind, folder, case))
        )
    after = random.Random(case).uniform(0.02, 4 if kind == "racer" else 0.6)
    return _ended(process_context().Process(target=go_on, args=(kind, folder)), after)


def killed_in_append(kind, folder, number, share, n_iterations):
    """Go on with a run until its `number`th append, or its end; return whether it was killed."""
    args = kind, folder, number, share, n_iterations
    return _ended(process_context().Process(target=_run_until_killed_in_append, args=args))


def _ended(child, after=None):
    """Let a process run, up to some seconds if it is to be killed then; return whether it was."""
    child.start()
    if after is not None:
        sleep(after)
        child.kill()
    child.join(60)
    assert child.exitcode in (0, -signal.SIGKILL), child.exitcode
    return child.exitcode != 0
