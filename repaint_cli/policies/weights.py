"""Weights in and out: safetensors, strict, atomic, leaf by leaf. No pickle."""

import hashlib
import json
from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import Any

import torch
from safetensors.numpy import save as serialized
from torch import Tensor

from repaint_cli.errors import CheckpointError
from repaint_cli.files.atomic import written_whole
from repaint_cli.files.headers import HASH, KEY, header_of, opened
from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.networks import ActorCritic, leaves_of
from repaint_cli.policies.spaces import Spaces

TYPES = {
    "F64": "float64", "F32": "float32", "I64": "int64", "I32": "int32", "U8": "uint8",
    "BOOL": "bool",
}  # fmt: skip
"""What our files hold, as safetensors and as we name it."""

MOST_NUMBERS = 2**28
"""In the networks of a file, 1 GB: a hole in a file takes no room on a disk, but in memory."""


def save(
    path: Path, tensors: Mapping[str, Tensor], header: Mapping[str, Any], *, new: bool = False
) -> None:
    """Write tensors, a JSON header and the hash of both as one safetensors file.

    It is written whole or not at all; with `new` not over another (see `files.written_whole`).
    """
    text = json.dumps({**header, HASH: content_hash(tensors, header)})
    arrays = {name: tensor.detach().contiguous().numpy() for name, tensor in tensors.items()}
    packed = serialized(arrays, metadata={KEY: text})  # two keys would be in any order
    with written_whole(path, new=new) as temporary:
        temporary.write_bytes(packed)  # safetensors' own way leaves files behind when it is killed


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
        for name in file.keys():  # noqa: SIM118
            if file.get_slice(name).get_dtype() not in TYPES:
                raise CheckpointError(f"{path}: leaf '{name:.100}' has a type we do not write")
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    if wanted is not None and wanted != content_hash(tensors, header):
        raise CheckpointError(
            f"{path} is not what was written: its {HASH} does not match; copy or train it again"
        )
    for name, tensor in tensors.items():
        if finite and not torch.isfinite(tensor).all():
            raise CheckpointError(f"{path}: leaf '{name:.100}' holds numbers that are not finite")
    return tensors, header


def content_hash(tensors: Mapping[str, Tensor], header: Mapping[str, Any]) -> str:
    """Return the SHA-256 of a header and of every tensor's name, type, shape and bytes."""
    found = hashlib.sha256(json.dumps(header).encode())
    for name, tensor in sorted(tensors.items()):
        found.update(f"\n{name} {_kind(tensor, tensor.shape)}\n".encode())
        found.update(tensor.detach().contiguous().numpy().reshape(-1).view("u1").data)
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


def _kind(tensor: Tensor, shape: torch.Size) -> str:
    return f"{tuple(shape)} {str(tensor.dtype).removeprefix('torch.')}"


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
"""Shape and type."""


def _check_forms(
    found: Mapping[str, Form], spaces: Spaces, net: NetConfig, n_seeds: int, where: str
) -> None:
    forms = forms_of(spaces, net)
    numbers = n_seeds * sum(prod(shape) for shape, _ in forms.values())
    for name, (shape, kind) in forms.items():
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
    for name in sorted(found.keys() - forms.keys()):
        raise CheckpointError(f"{where}: leaf '{name:.100}' is unknown to the network")


def forms_of(spaces: Spaces, net: NetConfig) -> dict[str, Form]:
    """Return what a file keeps of one seed's networks; nothing is allocated."""
    leaves = [leaf for tower in leaves_of(spaces, net).values() for leaf in tower]
    forms: dict[str, Form] = {leaf.name: (leaf.shape, "float32") for leaf in leaves}
    if not spaces.image:
        forms |= {f"normalizer.{name}": (spaces.obs_shape, "float64") for name in ("mean", "var")}
        forms["normalizer.count"] = ((), "float64")
    return forms
