"""The whole state of a learner after an iteration, in one file: `--resume` starts from it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from torch import Tensor

from repaint_cli import __version__
from repaint_cli.errors import CheckpointError
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.rollout.transitions import Experience
from repaint_cli.learn.states import below, with_prefix
from repaint_cli.learn.transfer.course import Course
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.weights import load, load_policy, policy_tensors, save

NETWORKS = "net/"
"""Prefix of the leaves of policies and critics."""


def save_learner(path: Path, learner: Learner, course: Course, notes: Mapping[str, Any]) -> None:
    """Write a learner (policies, critics, optimiser, counters), its course, and notes as JSON."""
    tensors = with_prefix(NETWORKS, policy_tensors(learner.student))
    tensors |= with_prefix("adam/", learner.optimizer.state())
    tensors |= course.state()
    if learner.memory:
        tensors |= with_prefix("memory/", learner.memory.state())
    counters = {
        "version": __version__,
        "seeds": learner.seeds,
        "iteration": learner.iteration,
        "env_steps": learner.env_steps.tolist(),
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
    except (KeyError, TypeError, ValueError, OverflowError) as error:
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
    learner.iteration = int(notes["iteration"])
    learner.env_steps = np.array(notes["env_steps"], int).reshape(len(learner.seeds))


def load_networks(path: Path, network: ActorCritic) -> None:
    """Put the policies and critics of a learner's checkpoint in place, and nothing else.

    Raises:
        CheckpointError: the file is damaged, or of another network.
    """
    tensors, _ = load(path)
    load_policy(network, below(NETWORKS, tensors), str(path))
