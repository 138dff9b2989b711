"""Evaluations of the first seed, a file each in the run's folder, for the figures."""

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

import numpy as np
import torch

from repaint_cli.envs.episodes import Episodes
from repaint_cli.errors import CheckpointError
from repaint_cli.policies.weights import load, save


def write(path: Path, k: int, episodes: Episodes, drawn: Sequence[str]) -> None:
    """Write the first seed's part of the evaluation after iteration k.

    Args:
        path: of the file.
        k: the iteration.
        episodes: of all seeds.
        drawn: the records that figures show.

    Raises:
        StoreError: the folder cannot be written.
    """
    first = episodes.of_seed(0)
    arrays = {
        part.name: value
        for part in fields(first)
        if isinstance(value := getattr(first, part.name), np.ndarray)
    }
    arrays |= {f"records/{name}": first.records[name] for name in drawn if name in first.records}
    tensors = {name: torch.from_numpy(np.ascontiguousarray(a)) for name, a in arrays.items()}
    save(path, tensors, {"iteration": k, "env_seeds": first.env_seeds})


def read(path: Path) -> Episodes:
    """Return what `write` wrote of the first seed.

    Raises:
        CheckpointError: the file is absent or damaged.
    """
    tensors, header = load(path, finite=False)
    arrays = {name: tensor.numpy() for name, tensor in tensors.items()}
    named = {part.name for part in fields(Episodes)}
    records = {n.removeprefix("records/"): a for n, a in arrays.items() if n.startswith("records/")}
    rest = dict.fromkeys(("paths", "targets")) | {n: a for n, a in arrays.items() if n in named}
    try:
        return Episodes(**rest, records=records, env_seeds=header["env_seeds"])
    except (KeyError, TypeError) as error:
        raise CheckpointError(f"{path} holds no evaluation: {error}") from error
