"""Whether a policy's numbers are in a task what they were where it was trained.

Sizes alone do not tell: 1 may be a third of a motor's force here and all of it there, and a picture
may have its channels first, or numbers from 0 to 1.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import gymnasium
import numpy as np
import torch
from torch import Tensor

from repaint_cli.errors import TeacherMismatch
from repaint_cli.policies.spaces import Spaces

NO_BOUND = 1e30
"""A bound beyond it is none: Gymnasium's environments have had the largest float32, or infinity."""


@dataclass(frozen=True)
class Bounds:
    """The bounds of a Box of vectors."""

    low: np.ndarray
    """(n,) float64."""
    high: np.ndarray
    """(n,) float64, not below `low`."""

    @classmethod
    def of(cls, space: gymnasium.spaces.Box) -> "Bounds":
        """Return the bounds of a Gymnasium space."""
        return cls(space.low.astype(np.float64), space.high.astype(np.float64))

    def differ(self, other: "Bounds") -> int | None:
        """Return the first dimension with other bounds, or None; a file may have lost digits."""
        same = np.isclose(self.low, other.low, 1e-6) & np.isclose(self.high, other.high, 1e-6)
        return None if same.all() else int(np.argmin(same))

    def text(self, dimension: int) -> str:
        """Return the bounds of a dimension, as people write them."""
        return f"[{self.low[dimension]:.6g}, {self.high[dimension]:.6g}]"


def channels_first(policy: Spaces, task: Spaces) -> str | None:
    """Return why a policy cannot read a task's pictures where their channels come first.

    A cube of pixels may be either; there Stable-Baselines3 takes the channels to be first.
    """
    if not policy.image or not task.image:
        return None
    height, width, channels = policy.obs_shape
    if task.obs_shape != (channels, height, width):
        return None
    return (
        f"the pictures of a task have their channels last, {height}×{width}×{channels}; found "
        f"{channels}×{height}×{width}: let the environment transpose them"
    )


def other_pixels(obs: gymnasium.Space) -> str | None:  # type: ignore[type-arg]
    """Return why a policy that divides pixels by 255 cannot read a task's pictures."""
    if obs.dtype == np.uint8:
        return None
    return f"it reads pixels from 0 to 255, uint8; the task's are {obs.dtype}"


def other_bounds(bounds: Bounds, space: Bounds) -> str | None:
    """Return why a policy's actions are not those of a task."""
    i = bounds.differ(space)
    if i is None:
        return None
    return (
        f"its action {i + 1} of {len(bounds.low)} is within {bounds.text(i)}, the task's within "
        f"{space.text(i)}: the same number is another action there"
    )


def observation_notice(
    bounds: Bounds | None,
    obs: gymnasium.Space,  # type: ignore[type-arg]
    task: str,
) -> str | None:
    """Return what people should know where a task's observations have other bounds.

    Versions of one environment differ in bounds that change nothing; a wrapper that scales
    observations shows in no other place.
    """
    if bounds is None or not isinstance(obs, gymnasium.spaces.Box) or len(obs.shape) != 1:
        return None
    here, there = (_where_finite(each) for each in (Bounds.of(obs), bounds))
    i = there.differ(here)
    if i is None:
        return None
    return (
        f"observation {i + 1} of {len(here.low)} was within {there.text(i)} in training, is within "
        f"{here.text(i)} in '{task}': if a wrapper scaled it, the policy acts otherwise here; "
        "see whether the score is right"
    )


def _where_finite(bounds: Bounds) -> Bounds:
    """Return bounds that are infinite where they are nearly the largest numbers."""
    return Bounds(
        *(np.where(np.abs(edge) > NO_BOUND, np.copysign(np.inf, edge), edge)
          for edge in (bounds.low, bounds.high))
    )  # fmt: skip


def rescaled(
    leaves: Mapping[str, Tensor], bounds: Bounds, space: Bounds, where: str
) -> dict[str, Tensor]:
    """Return a policy whose actions are rescaled from its bounds to a task's.

        a′ = low′ + (a − low)·(high′ − low′) / (high − low)

    as Gymnasium's RescaleAction does; clipping at the new bounds is clipping at the old ones.

    Args:
        leaves: the policy, by our names.
        bounds: of its actions.
        space: the bounds of the task's actions.
        where: the policy's name, for messages.

    Raises:
        TeacherMismatch: a bound is infinite, or bounds leave no room between them.
    """
    sizes = bounds.high - bounds.low, space.high - space.low
    for size, of in zip(sizes, (bounds, space), strict=True):
        bad = ~(np.isfinite(size) & (size > 0))
        if bad.any():
            raise TeacherMismatch(
                f"{where}: expected finite bounds with room between them, to rescale actions, "
                f"found {of.text(int(np.argmax(bad)))}"
            )
    scale = torch.from_numpy(sizes[1] / sizes[0])
    shift = torch.from_numpy(space.low) - torch.from_numpy(bounds.low) * scale
    weight, bias, log_std = (
        leaves[f"policy.{name}"].double() for name in ("head.weight", "head.bias", "log_std")
    )
    return dict(leaves) | {
        "policy.head.weight": (weight * scale).float(),
        "policy.head.bias": (bias * scale + shift).float(),
        "policy.log_std": (log_std + scale.log()).float(),
    }
