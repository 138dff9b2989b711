"""Weights in and out: safetensors, strict, atomic, leaf by leaf. No pickle."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors.torch import save_file
from torch import Tensor

from repaint_cli.errors import CheckpointError
from repaint_cli.files import HASH, KEY, header_of, opened, written_whole
from repaint_cli.nets import ActorCritic


def save(
    path: Path, tensors: Mapping[str, Tensor], header: Mapping[str, Any], *, new: bool = False
) -> None:
    """Write tensors, a JSON header and the hash of both as one safetensors file.

    It is written whole or not at all; with `new` not over another (see `files.written_whole`).
    """
    whole = {name: tensor.detach().contiguous().clone() for name, tensor in tensors.items()}
    text = json.dumps({**header, HASH: content_hash(whole, header)})
    with written_whole(path, new=new) as temporary:
        save_file(whole, temporary, metadata={KEY: text})  # two keys would be in any order


def load(path: Path, *, finite: bool = True) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read all tensors and the header.

    Args:
        path: of the file.
        finite: whether its numbers have to be.

    Raises:
        CheckpointError: the file is absent, damaged, not one of ours, or holds numbers that are not
            finite.
    """
    with opened(path, "pt") as file:
        header, wanted = header_of(path, file)
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    if wanted is not None and wanted != content_hash(tensors, header):
        raise CheckpointError(
            f"{path} is not what was written: its {HASH} does not match; copy or train it again"
        )
    for name, tensor in tensors.items():
        if finite and not torch.isfinite(tensor).all():
            raise CheckpointError(f"{path}: leaf '{name}' holds numbers that are not finite")
    return tensors, header


def content_hash(tensors: Mapping[str, Tensor], header: Mapping[str, Any]) -> str:
    """Return the SHA-256 of a header and of every tensor's name, type, shape and bytes."""
    found = hashlib.sha256(json.dumps(header).encode())
    for name, tensor in sorted(tensors.items()):
        found.update(f"\n{name} {_kind(tensor, tensor.shape)}\n".encode())
        found.update(tensor.detach().numpy().reshape(-1).view("u1").data)
    return found.hexdigest()


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
        CheckpointError: a leaf is missing, left over, or of another shape or type.
    """
    leaves = policy_tensors(student)
    for name in sorted(leaves.keys() ^ tensors.keys()):
        found = "missing in the file" if name in leaves else "unknown to the network"
        raise CheckpointError(f"{where}: leaf '{name}' is {found}")
    for name, leaf in leaves.items():
        tensor = tensors[name]
        wanted = leaf.shape if tensor.ndim == leaf.ndim else leaf.shape[1:]
        if tensor.shape != wanted or tensor.dtype != leaf.dtype:
            raise CheckpointError(
                f"{where}: leaf '{name}' is {_kind(tensor, tensor.shape)} in the file, "
                f"{_kind(leaf, wanted)} in the network"
            )
    with torch.no_grad():
        for name, leaf in student.weights.items():
            leaf.copy_(tensors[name])
    if student.normalizer:
        prefix = "normalizer."
        parts = {n.removeprefix(prefix): t for n, t in tensors.items() if n.startswith(prefix)}
        student.normalizer.load(parts)


def _kind(tensor: Tensor, shape: torch.Size) -> str:
    return f"{tuple(shape)} {str(tensor.dtype).removeprefix('torch.')}"
