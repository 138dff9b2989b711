"""Weights written to and read from safetensors files, leaf by leaf and strictly."""

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
from repaint_cli.files.atomic import atomic_write
from repaint_cli.files.headers import HASH, KEY, header_of, open_weights
from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.parameters import leaves_of
from repaint_cli.policies.spaces import Spaces

TYPES = {
    "F64": "float64", "F32": "float32", "I64": "int64", "I32": "int32", "U8": "uint8",
    "BOOL": "bool",
}  # fmt: skip
"""Types in our files: safetensors' names of them, and ours."""

MAX_NUMBERS = 2**28
"""In the networks of a file, 1 GB: a sparse file takes memory that it does not take on a disk."""


def save(
    path: Path, tensors: Mapping[str, Tensor], header: Mapping[str, Any], *, new: bool = False
) -> None:
    """Write tensors, a JSON header and the hash of both as one safetensors file.

    The file is written whole or not at all; see `atomic_write`, also for `new`.

    Raises:
        StoreError: the file cannot be written, or exists and `new` is true.
    """
    tensors = {name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}
    text = json.dumps({**header, HASH: content_hash(tensors, header)})
    arrays = {name: tensor.numpy() for name, tensor in tensors.items()}
    packed = serialized(arrays, metadata={KEY: text})  # two keys would be in any order
    with atomic_write(path, new=new) as temporary:
        temporary.write_bytes(
            packed
        )  # safetensors' own writer leaves files behind when it is killed


def load(path: Path, *, finite: bool = True) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read all tensors and the header.

    Args:
        path: of the file.
        finite: whether to refuse numbers that are not finite.

    Raises:
        CheckpointError: the file is absent, damaged, not one of ours, or holds numbers that are not
            finite.
    """
    while True:
        before = _inode(path)
        try:
            tensors, header = _read(path)
            break
        except CheckpointError:
            if _inode(path) == before:  # else another file has taken its place between two reads
                raise
    for name, tensor in tensors.items():
        if finite and not torch.isfinite(tensor).all():
            raise CheckpointError(f"{path}: leaf '{name:.100}' holds numbers that are not finite")
    return tensors, header


def _inode(path: Path) -> int | None:
    try:
        return path.stat().st_ino
    except OSError:
        return None


def _read(path: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read all tensors and the header, and check that they are what was written."""
    with open_weights(path, "pt") as file:
        header, expected_hash = header_of(path, file)
        for name in file.keys():  # noqa: SIM118
            if file.get_slice(name).get_dtype() not in TYPES:
                raise CheckpointError(f"{path}: leaf '{name:.100}' has a type we do not write")
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    if expected_hash is not None and expected_hash != content_hash(tensors, header):
        raise CheckpointError(
            f"{path} is not what was written: its {HASH} does not match; copy or train it again"
        )
    return tensors, header


def content_hash(tensors: Mapping[str, Tensor], header: Mapping[str, Any]) -> str:
    """Return the SHA-256 of a header and of every tensor's name, type, shape and bytes."""
    digest = hashlib.sha256(json.dumps(header).encode())
    for name, tensor in sorted(tensors.items()):
        digest.update(f"\n{name} {tuple(tensor.shape)} {_type_name(tensor)}\n".encode())
        digest.update(tensor.detach().cpu().contiguous().numpy().reshape(-1).view("u1").data)
    return digest.hexdigest()


def policy_tensors(student: ActorCritic, seed: int | None = None) -> dict[str, Tensor]:
    """Return the leaves of one seed's networks, or of all seeds with their axis."""
    leaves = dict(student.weights)
    if student.normalizer:
        state = student.normalizer.state()
        leaves |= {f"normalizer.{name}": tensor for name, tensor in state.items()}
    return leaves if seed is None else {name: leaf[seed] for name, leaf in leaves.items()}


def load_policy(student: ActorCritic, tensors: Mapping[str, Tensor], where: str) -> None:
    """Copy leaves into networks: with their seed axis, or without it into every seed.

    Args:
        student: S policies and critics.
        tensors: by name.
        where: their origin, for messages.

    Raises:
        CheckpointError: a leaf is missing, left over, or of another shape or type; or the
            normaliser has a negative variance or count.
    """
    forms = {name: (tuple(leaf.shape), _type_name(leaf)) for name, leaf in tensors.items()}
    _check_forms(forms, student.spaces, student.net, student.n_seeds, where)
    for name in ("normalizer.var", "normalizer.count"):
        if name in tensors and (tensors[name] < 0).any():
            raise CheckpointError(f"{where}: leaf '{name:.100}' holds numbers below 0")
    with torch.no_grad():
        for name, leaf in student.weights.items():
            leaf.copy_(tensors[name])
    if student.normalizer:
        prefix = "normalizer."
        state = {n.removeprefix(prefix): t for n, t in tensors.items() if n.startswith(prefix)}
        student.normalizer.load(state)


def _type_name(tensor: Tensor) -> str:
    return str(tensor.dtype).removeprefix("torch.")


def check_networks(
    path: Path, spaces: Spaces, net: NetConfig, n_seeds: int, where: str, prefix: str = ""
) -> None:
    """Check that a file's leaves are those of such networks, before memory is allocated for any.

    Args:
        path: of the file.
        spaces: of the policies.
        net: their layers.
        n_seeds: S; the leaves may have no seed axis.
        where: for messages.
        prefix: of the leaves' names in the file.

    Raises:
        CheckpointError: the file is damaged, or a leaf is missing, left over, or of another shape
            or type.
    """
    forms = {}
    with open_weights(path, "numpy") as file:
        for name in file.keys():  # noqa: SIM118
            if name.startswith(prefix):
                leaf = file.get_slice(name)
                dtype = TYPES.get(leaf.get_dtype(), leaf.get_dtype())
                forms[name.removeprefix(prefix)] = (tuple(leaf.get_shape()), dtype)
    _check_forms(forms, spaces, net, n_seeds, where)


Form = tuple[tuple[int, ...], str]
"""Shape and type."""


def _check_forms(
    forms: Mapping[str, Form], spaces: Spaces, net: NetConfig, n_seeds: int, where: str
) -> None:
    """Check the forms of a file's leaves, with or without a seed axis.

    Raises:
        CheckpointError: a leaf is missing, left over, or of another shape or type, or there are
            too many numbers.
    """
    expected = forms_of(spaces, net)
    numbers = n_seeds * sum(prod(shape) for shape, _ in expected.values())
    for name, (seed_shape, dtype) in expected.items():
        if name not in forms:
            raise CheckpointError(f"{where}: leaf '{name:.100}' is missing in the file")
        file_shape, file_dtype = forms[name]
        shape = (n_seeds, *seed_shape) if len(file_shape) > len(seed_shape) else seed_shape
        if (file_shape, file_dtype) != (shape, dtype):
            raise CheckpointError(
                f"{where}: leaf '{name:.100}' is {file_shape} {file_dtype} in the file, "
                f"{shape} {dtype} in the network"
            )
    if numbers > MAX_NUMBERS:
        raise CheckpointError(
            f"{where}: expected at most {MAX_NUMBERS:,} numbers, found {numbers:,}"
        )
    for name in sorted(forms.keys() - expected.keys()):
        raise CheckpointError(f"{where}: leaf '{name:.100}' is unknown to the network")


def forms_of(spaces: Spaces, net: NetConfig) -> dict[str, Form]:
    """Return the form of every leaf of one seed's networks; nothing is allocated."""
    leaves = [leaf for network in leaves_of(spaces, net).values() for leaf in network]
    forms: dict[str, Form] = {leaf.name: (leaf.shape, "float32") for leaf in leaves}
    if not spaces.image:
        forms |= {f"normalizer.{name}": (spaces.obs_shape, "float64") for name in ("mean", "var")}
        forms["normalizer.count"] = ((), "float64")
    return forms
