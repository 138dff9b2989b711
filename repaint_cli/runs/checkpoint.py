"""A run's checkpoints, from which `--resume` starts: all that it is after an iteration, a file."""

import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError
from torch import Tensor

from repaint_cli import __version__
from repaint_cli.errors import CardError, CheckpointError
from repaint_cli.files.atomic import atomic_write
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.rollout.reward_scale import RewardScale
from repaint_cli.learn.rollout.stream import Stream
from repaint_cli.learn.rollout.transitions import Experience
from repaint_cli.learn.states import below, with_prefix
from repaint_cli.learn.transfer.course import Course
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.weights import load, load_policy, policy_tensors, save
from repaint_cli.runs.folder import remove
from repaint_cli.runs.metrics import cut_csv
from repaint_cli.runs.plan import Plan, difference, without_text
from repaint_cli.runs.progress import RunProgress
from repaint_cli.runs.teachers import RunTeachers
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.transfer_settings import TransferConfig

NETWORKS = "net/"
"""Prefix of the leaves of policies and critics."""
STREAMS = "stream/"
"""Prefix of what is kept of environments that rollouts go on with."""
REWARDS = "rewards/"
"""Prefix of the statistics that rewards are divided by."""


def save_learner(path: Path, learner: Learner, course: Course, notes: Mapping[str, Any]) -> None:
    """Write a learner (policies, critics, optimiser, counters), its course, and notes as JSON."""
    tensors = with_prefix(NETWORKS, policy_tensors(learner.student))
    tensors |= with_prefix("adam/", learner.optimizer.state())
    tensors |= course.state()
    if learner.memory:
        tensors |= with_prefix("memory/", learner.memory.state())
    if learner.reward_scale:
        tensors |= with_prefix(REWARDS, learner.reward_scale.state())
    for name, stream in learner.streams.items():
        if stream.env and stream.env.replayable:
            tensors |= with_prefix(f"{STREAMS}{name}/", stream.state())
    counters = {
        "version": __version__,
        "seeds": learner.seeds,
        "iteration": learner.iteration,
        "env_steps": learner.env_steps.tolist(),
        "episode_lengths": learner.episode_lengths.tolist(),
    }
    save(path, tensors, {**notes, **counters})


def load_learner(path: Path, learner: Learner, course: Course) -> dict[str, Any]:
    """Put a learner and its course back where `save_learner` left them; return the notes.

    Raises:
        CheckpointError: the file is damaged, or of another version, network or seeds.
    """
    tensors, notes = load(path)
    writer = notes.get("version", "before 0.1.0")
    if writer != __version__:
        raise CheckpointError(
            f"{path} was written by repaint {writer!s:.20}, this is repaint {__version__}, which "
            "would not go on as that one; resume it with the version that wrote it"
        )
    if notes.get("seeds") != learner.seeds:
        seeds = str(notes.get("seeds"))
        raise CheckpointError(f"{path} holds seeds {seeds:.100}, wanted {learner.seeds}")
    try:
        _put(path, tensors, notes, learner, course)
    except (LookupError, TypeError, ValueError, OverflowError) as error:
        raise CheckpointError(f"{path} lacks a part or has a wrong one: {error!s:.200}") from error
    return notes


def _put(
    path: Path,
    tensors: Mapping[str, Tensor],
    notes: Mapping[str, Any],
    learner: Learner,
    course: Course,
) -> None:
    load_policy(learner.student, below(NETWORKS, tensors), str(path))
    learner.optimizer.load(below("adam/", tensors))
    course.load(tensors)
    memory = below("memory/", tensors)
    learner.memory = Experience.of_state(memory) if memory else None
    rewards = below(REWARDS, tensors)
    learner.reward_scale = RewardScale.of_state(rewards) if rewards else None
    streams = below(STREAMS, tensors)
    names = sorted({name.partition("/")[0] for name in streams})
    learner.streams = {name: Stream.of_state(below(name + "/", streams)) for name in names}
    learner.iteration = int(notes["iteration"])
    learner.env_steps = np.array(notes["env_steps"], int).reshape(len(learner.seeds))
    lengths = np.array(notes["episode_lengths"], float)
    learner.episode_lengths = lengths.reshape(len(learner.seeds))


def load_networks(path: Path, network: ActorCritic) -> None:
    """Put the policies and critics of a learner's checkpoint in place, and nothing else.

    Raises:
        CheckpointError: the file is damaged, or of another network.
    """
    tensors, _ = load(path)
    load_policy(network, below(NETWORKS, tensors), str(path))


def save_checkpoint(
    plan: Plan, teachers: RunTeachers, learner: Learner, course: Course, progress: RunProgress
) -> None:
    """Write all that the run is after an iteration; keep as many earlier ones as planned.

    Raises:
        StoreError: the checkpoint cannot be written; the earlier checkpoint is as it was.
    """
    files, k = plan.files, learner.iteration
    if plan.keep > 1 and files.checkpoint.is_file():
        _copy(files.checkpoint, files.earlier_checkpoint(k - 1))
    notes = {"run": plan.identity(teachers), "past": progress.as_json()}
    save_learner(files.checkpoint, learner, course, notes)
    if plan.keep > 1:
        remove(files.earlier_checkpoint(k - plan.keep))


def _copy(path: Path, other: Path) -> None:
    """Put a file in the place of another, too; it takes no room where there are links.

    Raises:
        StoreError: the copy cannot be written.
    """
    with atomic_write(other) as temporary:
        temporary.unlink()
        try:
            os.link(path, temporary)
        except OSError:
            shutil.copyfile(path, temporary)


def restore(plan: Plan, teachers: RunTeachers, learner: Learner, course: Course) -> RunProgress:
    """Restore a learner and its course after a run's last whole iteration; return the rest.

    A run that was stopped before its first checkpoint starts anew. Where the newest checkpoint is
    damaged, the newest whole one of those kept counts.

    Raises:
        CheckpointError: all checkpoints are damaged, or of another run, version or teacher.
    """
    newest, earlier = plan.files.checkpoint, plan.files.earlier_checkpoints()
    if not newest.is_file() and not earlier:
        learner.iteration = 0
        return RunProgress()
    problems = []
    for path in (newest, *earlier.values()):
        try:
            notes = load_learner(path, learner, course)
            progress = RunProgress.from_notes(notes, path)
        except CheckpointError as error:
            problems.append(error)
            continue
        _check_identity(path, notes, plan, teachers)
        progress.notices = [f"{problem}; going on from {path.name}" for problem in problems]
        return progress
    raise problems[0]


def _check_identity(
    path: Path, notes: Mapping[str, Any], plan: Plan, teachers: RunTeachers
) -> None:
    """Check that a checkpoint is of the planned run.

    Raises:
        CheckpointError: the checkpoint is of another run.
    """
    text = difference(_with_defaults(notes.get("run")), plan.identity(teachers))
    if text:
        raise CheckpointError(
            f"{path} is of another run than run.json beside it: {text}; put back the one or the "
            "other"
        )


def _with_defaults(identity: Any) -> Any:
    """Return what identifies a run, with the defaults of settings that came after it."""
    if not isinstance(identity, Mapping):
        return identity
    try:
        task, transfer = dict(identity["task"]), identity["transfer"]
        task["ppo"] = {**task["ppo"], "n_iterations": 1}  # which does not belong to it
        if isinstance(code := task.get("reward_code"), Mapping):
            task["reward_code"] = {**code, "source": ""}  # which does not, either
        whole = TaskCard.parse(task, "a checkpoint").model_dump(mode="json")
        whole["ppo"]["n_iterations"] = None
        without_text(whole)
        known = TransferConfig.model_validate(transfer).model_dump(mode="json")
    except (CardError, ValidationError, LookupError, TypeError):
        return identity  # a setting of another version, which the difference names
    return {**identity, "task": whole, "transfer": known}


def settle(plan: Plan, progress: RunProgress, k: int) -> None:
    """Remove what a run's folder holds of iterations after k, and what was never finished.

    Raises:
        CheckpointError: metrics.csv lacks an iteration up to k.
        StoreError: the folder cannot be written.
    """
    files = plan.files
    if progress.source and progress.source != files.checkpoint:  # which is damaged
        _copy(progress.source, files.checkpoint)
    files.forget_after(k)
    for surplus in list(files.earlier_checkpoints().values())[plan.keep - 1 :]:
        remove(surplus)
    cut_csv(files.metrics, k, len(plan.seeds))
    files.remove_unfinished()
