"""All that a learner is after an iteration, in one file: what `--resume` goes on from."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch
from torch import Tensor

from repaint_cli import __version__
from repaint_cli.errors import CheckpointError
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.rollout.observations import Frames
from repaint_cli.learn.rollout.transitions import Experience, Transitions
from repaint_cli.learn.transfer.measured import Measured
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.weights import load, load_policy, policy_tensors, save

NETWORKS = "net/"
"""What the leaves of policies and critics begin with."""

_B = TypeVar("_B", bound=Transitions)


def save_learner(path: Path, learner: Learner, notes: Mapping[str, Any]) -> None:
    """Write all that a learner is (policies, critics, optimiser, counters), and notes as JSON."""
    tensors = _under(NETWORKS, policy_tensors(learner.student))
    tensors |= _under("adam/", learner.optimizer.state())
    tensors |= _under("last/", _last(learner))
    if learner.measured:
        tensors |= _under("measured/", learner.measured.state())
    if learner.last_batch:
        tensors |= _under("batch/", _batch(learner.last_batch))
    if learner.memory:
        tensors |= _under("memory/", _batch(learner.memory))
    counters = {
        "version": __version__,
        "seeds": learner.seeds,
        "iteration": learner.iteration,
        "env_steps": learner.env_steps.tolist(),
        "after_instance": learner.after_instance,
    }
    save(path, tensors, {**notes, **counters})


def load_learner(path: Path, learner: Learner) -> dict[str, Any]:
    """Put a learner back where `save_learner` left it; return the notes.

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
        _put(path, tensors, notes, learner)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise CheckpointError(f"{path} lacks a part or has a wrong one: {error!s:.200}") from error
    return notes


def _put(
    path: Path, tensors: Mapping[str, Tensor], notes: Mapping[str, Any], learner: Learner
) -> None:
    load_policy(learner.student, _parts(tensors, NETWORKS), str(path))
    learner.optimizer.load(_parts(tensors, "adam/"))
    last = _parts(tensors, "last/")
    learner.last_moments = (last["mean"], last["std"])
    learner.last_reward = last["reward"]
    learner.last_return = np.where(last["ended"], last["return"], np.nan)
    batch, memory, measured = (_parts(tensors, n) for n in ("batch/", "memory/", "measured/"))
    learner.last_batch = _read_batch(Transitions, batch) if batch else None
    learner.memory = _read_batch(Experience, memory) if memory else None
    learner.measured = Measured.load(measured) if measured else None
    learner.after_instance = bool(notes["after_instance"])
    learner.iteration = int(notes["iteration"])
    learner.env_steps = np.array(notes["env_steps"], int).reshape(len(learner.seeds))


def load_networks(path: Path, network: ActorCritic) -> None:
    """Put the policies and critics of a learner's checkpoint in place, and nothing else.

    Raises:
        CheckpointError: the file is damaged, or of another network.
    """
    tensors, _ = load(path)
    load_policy(network, _parts(tensors, NETWORKS), str(path))


def _under(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    return {prefix + name: tensor for name, tensor in tensors.items()}


def _parts(tensors: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {n.removeprefix(prefix): t for n, t in tensors.items() if n.startswith(prefix)}


def _last(learner: Learner) -> dict[str, Tensor]:
    mean, std = learner.last_moments
    returns = torch.from_numpy(learner.last_return)
    return {
        "mean": mean, "std": std, "reward": learner.last_reward,
        "return": returns.nan_to_num(0.0), "ended": ~returns.isnan(),
    }  # fmt: skip


def _batch(batch: Transitions) -> dict[str, Tensor]:
    """Return a batch as tensors, each seed's observations by themselves: store/0/camera."""
    tensors = {**batch.parts, "counts": batch.counts}
    for s, store in enumerate(batch.frames.stores):
        named = store if isinstance(store, Mapping) else {"": store}
        tensors |= {f"store/{s}/{name}": part for name, part in named.items()}
    return tensors


def _read_batch(kind: type[_B], tensors: Mapping[str, Tensor]) -> _B:
    named = [_parts(tensors, f"store/{s}/") for s in range(len(tensors["counts"]))]
    stores: list[Any] = [parts.get("", parts) for parts in named]
    rest = {name: part for name, part in tensors.items() if not name.startswith("store/")}
    return kind(frames=Frames(stores), **rest)
