"""Transfer without a number from the user: β, ζ, the next phase and the end, as measured.

The paper leaves this open (its section 7); the rule here is ours. J_T and J_S are mean returns in
the target task, of a teacher before the first iteration and of the student over its last two
evaluations, both by their most likely actions; e are their standard errors over episodes; Â′ and Â
are advantages of the teachers' and the student's last samples under the same critic; M counts
teachers:

    lead     L_k = J_T − J_S − √(e_T² + e_S²)
    β_k        = max(0, L_k) / (J_T − J_0) / M, at most 1/M; 0 where J_T ≤ J_0 or cos(w_T, w) ≤ 0
    kept       = the highest max(0, 2·P(Â′ > Â) − 1) of the samples of teachers with β_k > 0: ζ is
                 that quantile
    phase      = instance, after an iteration of the student's own, while some β_k > 0, until one
                 kept nothing or instance iterations have clearly gained less per step than own ones
    end        = for good, once every β was 0 two own iterations in a row

J_0 is the return of the student before it has learned anything, so β is the share of a teacher's
lead over a random policy that is left and more than chance, whatever the signs of the returns. A
teacher no better than the student teaches nothing, and what is left is PPO. Each part may be
automatic alone, with the end; of other rules the phase goes by what this one would keep. Seeds that
train side by side share the phase and the end, not β and ζ.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from torch import Tensor, tensor

from repaint_cli.learn.rollout.gae import Samples

N_QUANTILES = 101
"""Quantiles that stand for the student's advantages."""

UNKNOWN = 1e30
"""The error of a single number; a checkpoint holds finite numbers."""

PATIENCE = 2
"""Own iterations without any β after which the transfer is over."""


class Measurements:
    """How S students and M teachers did in the target task."""

    def __init__(self, own: np.ndarray, taught: Sequence[np.ndarray]) -> None:
        """Begin with evaluated returns (S, E) of the students and of each teacher."""
        self.own = self.random = self.before = mean_and_error(own)
        self.taught = np.stack([mean_and_error(returns) for returns in taught], 1)  # (2, M, S)
        self.quantiles = np.zeros((N_QUANTILES, len(own)))
        """Of Â in each student's last batch, (N_QUANTILES, S)."""
        self.leading: np.ndarray = np.ones((len(taught), len(own)), bool)
        """Whether a teacher was ahead of a student in the last own iteration, (M, S)."""
        self.share: np.ndarray | None = None
        """What was kept of the last teachers' samples, (S,)."""
        self.gains: dict[bool, list[float]] = {False: [], True: []}
        """Gains per step of the students' own iterations, and of instance iterations."""
        self.idle = 0
        """Own iterations in a row without any β."""

    def add_evaluation(self, returns: np.ndarray, steps: float, phase: str) -> None:
        """Add evaluated returns (S, E) of the students after an iteration of so many steps each."""
        evaluated = mean_and_error(returns)
        if phase != "critic":  # which does not move a policy
            gain = float((evaluated[0] - self.own[0]).mean()) / steps
            self.gains[phase == "instance"].append(gain)
        self.before, self.own = self.own, evaluated

    def add_advantages(self, samples: Samples) -> None:
        """Add the students' advantages, as the critic estimates them after its fit."""
        per_seed = zip(samples.advantages, samples.counts.tolist(), strict=True)
        levels = np.linspace(0, 1, N_QUANTILES)
        self.quantiles = np.stack([np.quantile(own[:n].numpy(), levels) for own, n in per_seed], 1)

    def betas(self, cosines: Sequence[float | None]) -> np.ndarray:
        """Return β_k of each teacher and student, (M, S); several teachers share 1."""
        teachers, teachers_error = self.taught
        own = (self.own[0] + self.before[0]) / 2
        own_error = np.hypot(self.own[1], self.before[1]) / 2
        whole = teachers - self.random[0]  # the lead over an untrained policy
        lead = teachers - own - np.sqrt(teachers_error**2 + own_error**2)
        with np.errstate(invalid="ignore", divide="ignore"):
            shares = np.where(whole > 0, np.clip(lead / whole, 0, 1), 0.0)
        opposed = [cosine is not None and cosine <= 0 for cosine in cosines]
        shares[opposed] = 0
        betas: np.ndarray = np.nan_to_num(shares) / len(teachers)
        return betas

    def add_betas(self, betas: np.ndarray) -> None:
        """Add which β an own iteration had, (M, S)."""
        self.leading = betas > 0
        self.idle = 0 if betas.any() else self.idle + 1

    @property
    def ended(self) -> bool:
        """Whether the transfer is over."""
        return self.idle >= PATIENCE

    def shares(self, samples: Samples) -> Tensor:
        """Return how much of the teachers' samples each seed keeps, (S,), and store it."""
        shares = []
        for s, n in enumerate(samples.counts.tolist()):
            if n == 0:
                shares.append(0.0)
                continue
            advantages = np.sort(samples.advantages[s, :n].numpy())
            below = np.searchsorted(advantages, self.quantiles[:, s], side="right")
            shares.append(max(0.0, 2 * float(1 - below.mean() / n) - 1))
        self.share = np.array(shares)
        return tensor(shares)

    def instances_pay(self) -> bool:
        """Return whether an instance iteration should follow one of the students' own.

        Seeds that train side by side share the answer.
        """
        if not self.leading.any() or (self.share is not None and not self.share.any()):
            return False
        (own, own_error), (taught, error) = (
            mean_and_error(np.array([gains])).T[0] for gains in self.gains.values()
        )
        return not taught + error < own - own_error

    def state(self) -> dict[str, Tensor]:
        """Return all of it as tensors, for a checkpoint."""
        arrays = {
            "own": self.own, "before": self.before, "random": self.random, "taught": self.taught,
            "quantiles": self.quantiles, "idle": np.array([self.idle]), "leading": self.leading,
            "share": np.zeros(0) if self.share is None else self.share,
            "own_gains": np.array(self.gains[False]), "gains": np.array(self.gains[True]),
        }  # fmt: skip
        return {name: tensor(array) for name, array in arrays.items()}

    @classmethod
    def of_state(cls, state: Mapping[str, Tensor]) -> "Measurements":
        """Return the measurements that `state` described.

        Raises:
            KeyError: a tensor is missing.
        """
        arrays = {name: value.numpy() for name, value in state.items()}
        measurements = cls.__new__(cls)
        for name in ("own", "before", "random", "taught", "quantiles", "leading"):
            setattr(measurements, name, arrays[name])
        measurements.idle = int(arrays["idle"][0])
        measurements.share = arrays["share"] if len(arrays["share"]) else None
        measurements.gains = {
            False: arrays["own_gains"].tolist(), True: arrays["gains"].tolist()
        }  # fmt: skip
        return measurements


def mean_and_error(rows: np.ndarray) -> np.ndarray:
    """Return each row's mean and its standard error, (2, S), of (S, E); `UNKNOWN` of one number."""
    n = rows.shape[1]
    if n < 2:
        return np.stack([rows.mean(1) if n else np.zeros(len(rows)), np.full(len(rows), UNKNOWN)])
    return np.stack([rows.mean(1), rows.std(1, ddof=1) / np.sqrt(n)])
