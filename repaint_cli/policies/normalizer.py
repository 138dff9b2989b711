"""The running normaliser of observations, saved and loaded with the policy."""

from copy import copy

import torch
from torch import Tensor

FAR = 10
"""How many times less than `min_std` is far below it."""
CONSTANT = 1e-6
"""A deviation, also as a share of the mean, that is rounding."""


class Normalizer:
    """Running mean and standard deviation of each seed's observations, part of the policy.

    Observations leave it as clip((x − mean) / max(std, min_std), ±clip); before its first update
    unchanged but clipped. One that is not active leaves them as they are, and learns no statistics.
    """

    def __init__(
        self,
        n_seeds: int,
        n_features: int,
        clip: float = 5.0,
        min_std: float = 0.1,
        *,
        active: bool = True,
        device: str | torch.device = "cpu",
    ) -> None:
        self.clip, self.min_std, self.active = clip, min_std, active
        self.mean = torch.zeros(n_seeds, n_features, dtype=torch.float64, device=device)
        self.var = torch.ones_like(self.mean)
        self.count = torch.zeros(n_seeds, dtype=torch.float64, device=device)
        # a deviation near 0 magnifies the mean's rounding error, so without min_std: in float64
        dtype = torch.float32 if min_std else torch.float64
        self._shift = torch.empty(n_seeds, 1, n_features, dtype=dtype, device=device)
        self._scale = torch.empty_like(self._shift)
        self._refresh()

    def alone(self, seed: int) -> "Normalizer":
        """Return one seed's normaliser in the same memory; it is read, not updated."""
        one, row = copy(self), slice(seed, seed + 1)
        one.mean, one.var, one.count = self.mean[row], self.var[row], self.count[row]
        one._shift, one._scale = self._shift[row], self._scale[row]
        return one

    def _refresh(self) -> None:
        std = self.var.sqrt().clamp(min=self.min_std).to(self._scale.dtype)
        self._shift.copy_(self.mean.unsqueeze(1))
        self._scale.copy_(1 / std.unsqueeze(1))

    def normalize(self, obs: Tensor) -> Tensor:
        """Return normalised observations (S, B, O) float32."""
        if not self.active:
            return obs.float()
        return ((obs - self._shift) * self._scale).clamp(-self.clip, self.clip).float()

    def update(self, seed: int, obs: Tensor) -> None:
        """Merge a seed's new observations (B, O) into its statistics (Chan et al. 1979)."""
        if not self.active:
            return
        x = obs.to(self.mean.device).double()
        n, m = self.count[seed], len(x)
        delta = x.mean(0) - self.mean[seed]
        squares = n * self.var[seed] + m * x.var(0, correction=0) + delta**2 * n * m / (n + m)
        self.mean[seed] += delta * m / (n + m)
        self.var[seed] = squares / (n + m)
        self.count[seed] = n + m
        self._refresh()

    def narrow_features(self) -> dict[int, float]:
        """Return the least deviation over seeds of features far below `min_std`, by their number.

        The networks see next to nothing of them. Those that never change are not among them.
        """
        if not self.active:
            return {}
        deviation = self.var.sqrt()  # (S, O)
        constant = deviation <= (CONSTANT * self.mean.abs()).clamp(min=CONSTANT)
        far_below = (deviation < self.min_std / FAR) & ~constant
        least = deviation.masked_fill(~far_below, torch.inf).amin(0)
        return {int(i): float(least[i]) for i in far_below.any(0).nonzero()}

    def state(self) -> dict[str, Tensor]:
        """Return the statistics `mean`, `var` (S, O) and `count` (S,)."""
        return {"mean": self.mean, "var": self.var, "count": self.count}

    def load(self, state: dict[str, Tensor]) -> None:
        """Copy the statistics `mean`, `var` (S, O) and `count` (S,) from a file's leaves."""
        self.mean.copy_(state["mean"])
        self.var.copy_(state["var"])
        self.count.copy_(state["count"])
        self._refresh()
