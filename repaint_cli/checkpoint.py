"""Weights in and out: safetensors, strict, atomic, leaf by leaf. No pickle."""

import json
from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors.torch import save_file
from torch import Tensor

from repaint_cli.architecture import NetConfig
from repaint_cli.errors import CheckpointError
from repaint_cli.files import KEY, header_of, opened, written_whole
from repaint_cli.learn.automatic import Measured
from repaint_cli.learn.frames import Frames
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.transitions import Transitions
from repaint_cli.nets import ActorCritic, leaves_of
from repaint_cli.spaces import Spaces

NETWORKS = "net/"
"""What the leaves of policies and critics begin with in a learner's checkpoint."""


def save(path: Path, tensors: Mapping[str, Tensor], header: Mapping[str, Any]) -> None:
    """Write tensors and a JSON header as one safetensors file, whole or not at all."""
    whole = {name: tensor.detach().contiguous().clone() for name, tensor in tensors.items()}
    with written_whole(path) as temporary:
        save_file(whole, temporary, metadata={KEY: json.dumps(header)})


TYPES = {
    "F64": "float64", "F32": "float32", "I64": "int64", "I32": "int32", "U8": "uint8",
    "BOOL": "bool",
}  # fmt: skip
"""What our files hold, as safetensors and as we name it."""


MOST_NUMBERS = 2**28
"""In the networks of a file, 1 GB: a hole in a file takes no room on a disk, but in memory."""


def load(path: Path, prefix: str = "") -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read the tensors whose names begin so, without that, and the header.

    Raises:
        CheckpointError: the file is absent, damaged, not one of ours, or holds numbers that are not
            finite.
    """
    with opened(path, "pt") as file:
        header = header_of(path, file)
        names = [name for name in file.keys() if name.startswith(prefix)]  # noqa: SIM118
        for name in names:
            if file.get_slice(name).get_dtype() not in TYPES:
                raise CheckpointError(f"{path}: leaf '{name:.100}' has a type we do not write")
        tensors = {name.removeprefix(prefix): file.get_tensor(name) for name in names}
    for name, tensor in tensors.items():
        if not torch.isfinite(tensor).all():
            raise CheckpointError(f"{path}: leaf '{name:.100}' holds numbers that are not finite")
    return tensors, header


def policy_tensors(student: ActorCritic, seed: int | None = None) -> dict[str, Tensor]:
    """Return the leaves of one seed's networks, or of all seeds with their axis."""
    leaves = dict(student.weights)
    if student.normalizer:
        names = ("mean", "var", "count")
        leaves |= {f"normalizer.{name}": getattr(student.normalizer, name) for name in names}
    return leaves if seed is None else {name: leaf[seed] for name, leaf in leaves.items()}


def load_policy(student: ActorCritic, tensors: Mapping[str, Tensor], where: str) -> None:
    """Put leaves in place: with their seed axis, or without it into every seed.

    Raises:
        CheckpointError: a leaf is missing, left over, or of another shape or type; or what was
            observed has a negative variance or number.
    """
    forms = {n: (tuple(t.shape), str(t.dtype).removeprefix("torch.")) for n, t in tensors.items()}
    _check_forms(forms, student.spaces, student.net, student.n_seeds, where)
    for name in ("normalizer.var", "normalizer.count"):
        if name in tensors and (tensors[name] < 0).any():
            raise CheckpointError(f"{where}: leaf '{name:.100}' holds numbers below 0")
    with torch.no_grad():
        for name, leaf in student.weights.items():
            leaf.copy_(tensors[name])
    if student.normalizer:
        prefix = "normalizer."
        parts = {n.removeprefix(prefix): t for n, t in tensors.items() if n.startswith(prefix)}
        student.normalizer.load(parts)


def check_networks(
    path: Path, spaces: Spaces, net: NetConfig, n_seeds: int, where: str, prefix: str = ""
) -> None:
    """Check that a file's leaves are those of such networks, before there is any memory for them.

    Args:
        path: of the file.
        spaces: what the policies read and write.
        net: their layers.
        n_seeds: S; the leaves may have no seed axis.
        where: for messages.
        prefix: of the leaves' names in the file.

    Raises:
        CheckpointError: the file is damaged, or a leaf is missing, left over, or of another shape
            or type.
    """
    forms = {}
    with opened(path, "numpy") as file:
        for name in file.keys():  # noqa: SIM118
            if name.startswith(prefix):
                leaf = file.get_slice(name)
                kind = TYPES.get(leaf.get_dtype(), leaf.get_dtype())
                forms[name.removeprefix(prefix)] = (tuple(leaf.get_shape()), kind)
    _check_forms(forms, spaces, net, n_seeds, where)


Form = tuple[tuple[int, ...], str]


def _check_forms(
    found: Mapping[str, Form], spaces: Spaces, net: NetConfig, n_seeds: int, where: str
) -> None:
    known, numbers = set(), 0
    for name, shape, kind in leaves_of(spaces, net):
        known.add(name)
        numbers += prod(shape) * n_seeds
        if name not in found:
            raise CheckpointError(f"{where}: leaf '{name:.100}' is missing in the file")
        theirs, their_kind = found[name]
        wanted = (n_seeds, *shape) if len(theirs) > len(shape) else shape
        if (theirs, their_kind) != (wanted, kind):
            raise CheckpointError(
                f"{where}: leaf '{name:.100}' is {theirs} {their_kind} in the file, "
                f"{wanted} {kind} in the network"
            )
    if numbers > MOST_NUMBERS:
        raise CheckpointError(
            f"{where}: expected at most {MOST_NUMBERS:,} numbers, found {numbers:,}"
        )
    for name in sorted(found.keys() - known):
        raise CheckpointError(f"{where}: leaf '{name:.100}' is unknown to the network")


def save_learner(path: Path, learner: Learner, header: Mapping[str, Any]) -> None:
    """Write all that a learner is: policies, critics, optimiser, counters."""
    tensors = {f"net/{name}": leaf for name, leaf in policy_tensors(learner.student).items()}
    tensors |= {f"adam/{name}": part for name, part in learner.optimizer.state().items()}
    tensors |= {f"last/{name}": part for name, part in _last(learner).items()}
    if learner.measured:
        tensors |= {f"measured/{n}": part for n, part in learner.measured.state().items()}
    if learner.last_batch:
        tensors |= {f"batch/{n}": part for n, part in _batch(learner.last_batch).items()}
    counters = {
        "after_instance": learner.after_instance,
        "seeds": learner.seeds,
        "iteration": learner.iteration,
        "env_steps": learner.env_steps.tolist(),
    }
    save(path, tensors, {**header, **counters})


def load_learner(path: Path, learner: Learner) -> None:
    """Put a learner back where `save_learner` left it.

    Raises:
        CheckpointError: the file is damaged, or of another network or other seeds.
    """
    tensors, header = load(path)
    if header.get("seeds") != learner.seeds:
        raise CheckpointError(f"{path} holds seeds {header.get('seeds')}, wanted {learner.seeds}")

    def part(prefix: str) -> dict[str, Tensor]:
        return {n.removeprefix(prefix): t for n, t in tensors.items() if n.startswith(prefix)}

    load_policy(learner.student, part("net/"), str(path))
    learner.optimizer.load(part("adam/"))
    last = part("last/")
    learner.last_moments = (last["mean"], last["std"])
    learner.last_reward = last["reward"]
    learner.last_return = np.where(last["ended"], last["return"], np.nan)
    batch, measured = part("batch/"), part("measured/")
    learner.last_batch = _read_batch(batch) if batch else None
    learner.measured = Measured.load(measured) if measured else None
    learner.after_instance = header["after_instance"]
    learner.iteration = header["iteration"]
    learner.env_steps = np.array(header["env_steps"])


def _last(learner: Learner) -> dict[str, Tensor]:
    mean, std = learner.last_moments
    returns = torch.from_numpy(learner.last_return)
    return {
        "mean": mean, "std": std, "reward": learner.last_reward,
        "return": returns.nan_to_num(0.0), "ended": ~returns.isnan(),
    }  # fmt: skip


def _batch(batch: Transitions) -> dict[str, Tensor]:
    """Return a batch of vectors as tensors, each seed's observations by themselves."""
    stores = {f"store{s}": store for s, store in enumerate(batch.frames.stores)}
    return {**batch.parts, "counts": batch.counts, **stores}


def _read_batch(tensors: Mapping[str, Tensor]) -> Transitions:
    stores = [tensors[f"store{s}"] for s in range(len(tensors["counts"]))]
    rest = {name: part for name, part in tensors.items() if not name.startswith("store")}
    return Transitions(frames=Frames(stores), **rest)


def load_networks(path: Path, network: ActorCritic) -> None:
    """Put the policies and critics of a learner's checkpoint in place, and nothing else.

    Raises:
        CheckpointError: the file is damaged, or of another network.
    """
    leaves, _ = load(path, NETWORKS)
    load_policy(network, leaves, str(path))
