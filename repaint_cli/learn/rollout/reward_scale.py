"""The running deviation of discounted returns, which rewards are divided by before learning."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from torch import Tensor, from_numpy

from repaint_cli.learn.rollout.storage import Rollout

CLIP = 10.0
"""Scaled rewards are clipped to ± this, as VecNormalize's."""
EPSILON = 1e-8
"""Is added to the variance."""
INITIAL_COUNT = 1e-4
"""Steps that the first variance, 1, counts as."""


class RewardScale:
    """Statistics of each seed's discounted returns, as VecNormalize of Stable-Baselines3 has them.

    A return at a step is what its episode has earned until then, earlier rewards discounted:
    Rₜ = γ·Rₜ₋₁ + rₜ.
    """

    def __init__(self, n_seeds: int) -> None:
        self.mean, self.var = np.zeros(n_seeds), np.ones(n_seeds)
        self.count = np.full(n_seeds, INITIAL_COUNT)
        self.running = np.zeros((n_seeds, 0))
        """R of the episodes that go on, (S, N)."""

    def update(self, rollout: Rollout, gamma: float, *, continues: bool) -> None:
        """Add the steps of the students' rollout.

        Args:
            rollout: theirs.
            gamma: γ.
            continues: whether it goes on where the last one ended.
        """
        shape = rollout.valid.shape[1:]
        if not continues or self.running.shape != shape:
            self.running = np.zeros(shape)
        returns, running = np.zeros(rollout.valid.shape), self.running
        ends = rollout.terminations | rollout.truncations
        for t, valid in enumerate(rollout.valid):
            running = np.where(valid, gamma * running + rollout.rewards[t], running)
            returns[t] = running
            running = np.where(valid & ends[t], 0.0, running)
        self.running = running
        for s in range(shape[0]):
            self._merge(s, returns[:, s][rollout.valid[:, s]])

    def _merge(self, s: int, new: np.ndarray) -> None:
        """Merge a seed's new numbers into its statistics (Chan et al. 1979)."""
        n, m = self.count[s], len(new)
        if not m:
            return
        delta = new.mean() - self.mean[s]
        squares = n * self.var[s] + m * new.var() + delta**2 * n * m / (n + m)
        self.mean[s] += delta * m / (n + m)
        self.var[s], self.count[s] = squares / (n + m), n + m

    def applied(self, rollout: Rollout) -> Rollout:
        """Return a rollout whose learned rewards are scaled."""
        deviation = np.sqrt(self.var + EPSILON)[:, None]
        scaled = np.clip(rollout.rewards / deviation, -CLIP, CLIP)
        return replace(rollout, scaled_rewards=scaled)

    def state(self) -> dict[str, Tensor]:
        """Return it as tensors, for a checkpoint."""
        names = ("mean", "var", "count", "running")
        return {name: from_numpy(getattr(self, name).copy()) for name in names}

    @classmethod
    def of_state(cls, state: Mapping[str, Tensor]) -> "RewardScale":
        """Return the statistics that `state` described.

        Raises:
            KeyError: a tensor is missing.
        """
        scale = cls(len(state["count"]))
        for name in ("mean", "var", "count", "running"):
            setattr(scale, name, state[name].numpy().copy())
        return scale
