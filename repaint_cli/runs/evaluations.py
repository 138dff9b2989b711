"""How evaluations of the first seed went, a file each in the run's folder, for the pictures."""

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

import numpy as np
import torch

from repaint_cli.envs.episodes import Episodes
from repaint_cli.errors import CheckpointError
from repaint_cli.files.atomic import write_errors
from repaint_cli.policies.weights import load, save

FOLDER = "evaluations"


def keep(run: Path, k: int, played: Episodes, drawn: Sequence[str]) -> None:
    """Write the first seed's part of the evaluation after iteration k.

    Args:
        run: the run's folder.
        k: the iteration.
        played: the evaluation of all seeds.
        drawn: the records that figures show.

    Raises:
        StoreError: the folder cannot be written.
    """
    first = played.of_seed(0)
    arrays = {
        part.name: value
        for part in fields(first)
        if isinstance(value := getattr(first, part.name), np.ndarray)
    }
    arrays |= {f"records/{name}": first.records[name] for name in drawn if name in first.records}
    tensors = {name: torch.from_numpy(np.ascontiguousarray(a)) for name, a in arrays.items()}
    save(_file(run, k), tensors, {"iteration": k, "env_seeds": first.env_seeds})


def kept(run: Path) -> dict[int, Path]:
    """Return the files of the evaluations that are kept, by iteration, in order."""
    files = (run / FOLDER).glob("[0-9]*.safetensors")
    return dict(sorted((int(path.stem), path) for path in files if path.stem.isdecimal()))


def forget_after(run: Path, k: int) -> None:
    """Remove the evaluations after iteration k.

    Raises:
        StoreError: they cannot be removed.
    """
    for later, path in kept(run).items():
        if later > k:
            with write_errors(path):
                path.unlink()


def read(run: Path, k: int) -> Episodes:
    """Return what `keep` was given of the first seed.

    Raises:
        CheckpointError: the file is absent or damaged.
    """
    tensors, header = load(_file(run, k), finite=False)
    arrays = {name: tensor.numpy() for name, tensor in tensors.items()}
    named = {part.name for part in fields(Episodes)}
    records = {n.removeprefix("records/"): a for n, a in arrays.items() if n.startswith("records/")}
    rest = dict.fromkeys(("paths", "targets")) | {n: a for n, a in arrays.items() if n in named}
    try:
        return Episodes(**rest, records=records, env_seeds=header["env_seeds"])
    except (KeyError, TypeError) as error:
        raise CheckpointError(f"{_file(run, k)} holds no evaluation: {error}") from error


def _file(run: Path, k: int) -> Path:
    return run / FOLDER / f"{k:05}.safetensors"
