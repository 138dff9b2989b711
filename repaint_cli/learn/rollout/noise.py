"""The noise by which policies draw their actions."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from repaint_cli.policies.distributions import Distribution


class ActionNoise:
    """Each seed's own stream of noise for its N environments, drawn 64 steps at a time."""

    def __init__(self, rngs: Sequence[np.random.Generator], n_envs: int) -> None:
        self._rngs, self._n_envs, self._t = rngs, n_envs, 0
        self._block = np.empty(0)

    def draw(self, distribution: Distribution, envs: Any) -> Tensor:
        """Return the noise of one step for some environments, (S, N, A)."""
        if self._t % 64 == 0:
            shape = (64, self._n_envs, distribution.n_actions)
            self._block = np.stack([distribution.noise(rng, shape) for rng in self._rngs], axis=1)
        noise = self._block[self._t % 64]  # (S, N, A)
        self._t += 1
        return torch.from_numpy(noise[envs])
