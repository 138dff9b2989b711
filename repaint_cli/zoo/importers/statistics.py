"""How a policy from elsewhere saw its observations: a normaliser's statistics, from a file.

VecNormalize saves itself as a pickle, which is read as data. Whatever is not understood there can
be given as an .npz file in its place.
"""

import io
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from repaint_cli.errors import CheckpointError, UsageError
from repaint_cli.files.limits import read_bytes
from repaint_cli.zoo.importers.archives import read_members
from repaint_cli.zoo.importers.pickles import Record, Refused, array_of, number_of, read, shaped

LARGEST = 16 * 2**20
"""Bytes that a file of statistics may have."""

CLIP, EPSILON = 10.0, 1e-8
"""What VecNormalize does where it is not told otherwise, and cleanrl's wrappers do."""

WAY_OUT = (
    "give numbers instead: numpy.savez('stats.npz', mean=v.obs_rms.mean, var=v.obs_rms.var, "
    "clip_obs=v.clip_obs, epsilon=v.epsilon) and --vecnormalize stats.npz"
)


@dataclass(frozen=True)
class Statistics:
    """Observations were seen as clip((x − mean) / √var, ±clip)."""

    mean: np.ndarray
    """Of each number, (O,)."""
    var: np.ndarray
    """Of each number, with what was added to it against division by 0, (O,)."""
    clip: float
    """Above 0."""
    count: float = 0.0
    """How many observations they are of."""


def read_statistics(path: Path) -> Statistics | None:
    """Read a VecNormalize's file, or an .npz file with `mean`, `var` and perhaps other settings.

    Returns:
        None where observations were not normalised.

    Raises:
        CheckpointError: the file is absent or damaged, or holds something else.
    """
    data = read_bytes(path, CheckpointError, LARGEST)
    if path.suffix == ".npz":
        return _from_arrays(data, path)
    try:
        return _from_vecnormalize(read(data))
    except Refused as error:
        raise CheckpointError(
            f"{path}: expected what VecNormalize.save writes, found {error}; {WAY_OUT}"
        ) from error


def statistics_of(path: Path, given: str | None, normalised: bool) -> Statistics | None:
    """Return how a policy saw its observations, None as they are.

    Args:
        path: the policy's file.
        given: a file of statistics, or "none".
        normalised: whether the policy was trained on normalised observations.

    Raises:
        UsageError: it was, and nothing is given.
        CheckpointError: what is given holds something else.
    """
    if given is None and normalised:
        raise UsageError(
            f"the policy in {path} saw normalised observations, whose statistics are in another "
            "file or none: expected --vecnormalize with VecNormalize's file or an .npz of mean and "
            "var, or --vecnormalize none"
        )
    return read_statistics(Path(given)) if given and given != "none" else None


def _from_vecnormalize(found: Any) -> Statistics | None:
    """Return the statistics of a VecNormalize, as far as its record goes."""
    state = _state(found, "VecNormalize")
    if state.get("norm_obs") is False:
        return None
    if isinstance(state.get("obs_rms"), dict | Record) and not _is(state["obs_rms"], _RUNNING):
        raise Refused("statistics of several observations by name")
    moments = _state(state.get("obs_rms"), _RUNNING)
    mean, var = (array_of(moments.get(name)) for name in ("mean", "var"))
    numbers = [state.get("clip_obs"), state.get("epsilon"), moments.get("count")]
    return _checked(mean, var, *map(number_of, numbers))


_RUNNING = "RunningMeanStd"


def _is(found: Any, name: str) -> bool:
    return isinstance(found, Record) and found.name.endswith(f".{name}")


def _state(found: Any, name: str) -> dict[str, Any]:
    if not _is(found, name) or not isinstance(found.state, dict):
        raise Refused(f"no {name}")
    return found.state


def _from_arrays(data: bytes, path: Path) -> Statistics:
    """Return the statistics in an .npz file."""
    usual = {"clip_obs.npy": CLIP, "epsilon.npy": EPSILON, "count.npy": 0.0}
    parts = read_members(data, str(path), ["mean.npy", "var.npy"], usual)
    try:
        arrays = {name: _array(part) for name, part in parts.items()}
        mean, var = arrays.pop("mean.npy"), arrays.pop("var.npy")
        told = {name: _single(array) for name, array in arrays.items()}
        return _checked(mean, var, *(usual | told).values())
    except Refused as error:
        raise CheckpointError(
            f"{path}: expected arrays of numbers as numpy.savez writes them, found {error}"
        ) from error


def _single(array: np.ndarray) -> float:
    if array.size != 1:
        raise Refused(f"{array.size} numbers where one is wanted")
    return float(array.item())


def _array(data: bytes) -> np.ndarray:
    """Return the array in an .npy file; one that is not of numbers is refused."""
    file = io.BytesIO(data)
    try:
        if np.lib.format.read_magic(file) != (1, 0):
            raise Refused("another version")
        shape, fortran, kind = np.lib.format.read_array_header_1_0(file)
    except Exception as error:  # numpy evaluates a literal, which can fail in many ways
        raise Refused("a header of another kind") from error
    if kind.kind not in "fiu":
        raise Refused(f"an array of {kind}")
    return shaped(file.read(), kind, shape, fortran=fortran)


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
