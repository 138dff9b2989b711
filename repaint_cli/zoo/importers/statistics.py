"""How an imported policy normalises its observations: statistics from a file.

VecNormalize saves itself as a pickle, which is read as data. Where that is not possible, an .npz
file takes its place.
"""

from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from repaint_cli.errors import CheckpointError, UsageError, reported_as
from repaint_cli.files.limits import read_bytes
from repaint_cli.files.npy import NotAnArray, read_npy
from repaint_cli.zoo.importers.archives import read_members
from repaint_cli.zoo.importers.pickles import Record, Refused, array_of, number_of, parse_pickle

MAX_BYTES = 16 * 2**20
"""Bytes that a file of statistics may have."""

CLIP, EPSILON = 10.0, 1e-8
"""The defaults of VecNormalize, and the constants of cleanrl's wrappers."""

ADVICE = (
    "give numbers instead: numpy.savez('stats.npz', mean=v.obs_rms.mean, var=v.obs_rms.var, "
    "clip_obs=v.clip_obs, epsilon=v.epsilon) and --vecnormalize stats.npz"
)


@dataclass(frozen=True)
class Statistics:
    """The policy observes clip((x − mean) / √var, ±clip)."""

    mean: np.ndarray
    """(O,)."""
    var: np.ndarray
    """(O,), with epsilon added, so that no division is by 0."""
    clip: float
    """Above 0."""
    count: float = 0.0
    """Observations in the statistics."""


def read_statistics(path: Path) -> Statistics | None:
    """Read a VecNormalize's file, or an .npz file with `mean`, `var` and perhaps other settings.

    Returns:
        None where observations were not normalised.

    Raises:
        CheckpointError: the file is absent or damaged, or holds no statistics.
    """
    with reported_as(CheckpointError):
        data = read_bytes(path, MAX_BYTES)
    if path.suffix == ".npz":
        return _from_arrays(data, path)
    try:
        return _from_vecnormalize(parse_pickle(data))
    except Refused as error:
        raise CheckpointError(
            f"{path}: expected what VecNormalize.save writes, found {error}; {ADVICE}"
        ) from error


def statistics_of(path: Path, given: str | None, normalised: bool | None) -> Statistics | None:
    """Return the statistics of a policy's observations; None where they are not normalised.

    Args:
        path: the policy's file.
        given: a file of statistics, or "none".
        normalised: whether the policy was trained on normalised observations; None where that is
            not known.

    Raises:
        UsageError: the policy was trained on normalised observations, and no file is given; or one
            is, and it was not.
        CheckpointError: the given file is absent or damaged, or holds no statistics.
    """
    if given is None and normalised:
        raise UsageError(
            f"the policy in {path} saw normalised observations, whose statistics are in another "
            "file or none: expected --vecnormalize with VecNormalize's file or an .npz of mean and "
            "var, or --vecnormalize none"
        )
    statistics = read_statistics(Path(given)) if given and given != "none" else None
    if statistics and normalised is False:
        raise UsageError(
            f"the policy in {path} saw observations as they are when it was last trained: expected "
            f"no --vecnormalize, or --vecnormalize none, found {given}"
        )
    return statistics


def _from_vecnormalize(record: Any) -> Statistics | None:
    """Return the statistics in the record of a VecNormalize."""
    state = _state(record, "VecNormalize")
    if state.get("norm_obs") is False:
        return None
    if isinstance(state.get("obs_rms"), dict | Record) and not _is(state["obs_rms"], _RUNNING):
        raise Refused("statistics of several observations by name")
    moments = _state(state.get("obs_rms"), _RUNNING)
    mean, var = (array_of(moments.get(name)) for name in ("mean", "var"))
    numbers = [state.get("clip_obs"), state.get("epsilon"), moments.get("count")]
    return _checked(mean, var, *map(number_of, numbers))


_RUNNING = "RunningMeanStd"


def _is(record: Any, name: str) -> bool:
    return isinstance(record, Record) and record.name.endswith(f".{name}")


def _state(record: Any, name: str) -> dict[str, Any]:
    if not _is(record, name) or not isinstance(record.state, dict):
        raise Refused(f"no {name}")
    return record.state


def _from_arrays(data: bytes, path: Path) -> Statistics:
    """Return the statistics in an .npz file."""
    defaults = {"clip_obs.npy": CLIP, "epsilon.npy": EPSILON, "count.npy": 0.0}
    parts = read_members(data, str(path), ["mean.npy", "var.npy"], defaults)
    try:
        arrays = {name: read_npy(part, kinds="fiu") for name, part in parts.items()}
        mean, var = arrays.pop("mean.npy"), arrays.pop("var.npy")
        settings = {name: _single(array) for name, array in arrays.items()}
        return _checked(mean, var, *(defaults | settings).values())
    except (NotAnArray, Refused) as error:
        raise CheckpointError(
            f"{path}: expected arrays of numbers as numpy.savez writes them, found {error}"
        ) from error


def _single(array: np.ndarray) -> float:
    if array.size != 1:
        raise Refused(f"{array.size} numbers where one is wanted")
    return float(array.item())


def _checked(
    mean: np.ndarray, var: np.ndarray, clip: float, epsilon: float, count: float
) -> Statistics:
    if mean.ndim != 1 or mean.shape != var.shape:
        raise Refused(f"a mean of shape {mean.shape} and a variance of shape {var.shape}")
    mean, spread = mean.astype(np.float64), var.astype(np.float64) + epsilon
    numbers = isfinite(epsilon) and isfinite(count) and count >= 0 and clip > 0
    if not numbers or not (
        np.isfinite(mean).all() and np.isfinite(spread).all() and (spread > 0).all()
    ):
        raise Refused("numbers that are not finite, or not above 0")
    return Statistics(mean, spread, clip, count)
