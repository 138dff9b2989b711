"""Transfer without a number from the user: β, what is kept, next phase and end, as measured.

The paper leaves this open (its section 7); the rule here is ours. J_T is a teacher's mean return in
the target task before the first iteration, by its most likely actions, and J_0 that of untrained
policies. J_S is the student's: numbered actions are drawn as it draws them, in its last rollout;
of continuous ones the most likely are taken, in its last two evaluations, as the noise in them
would hide what it has learned. e are standard errors over episodes. Â′ and Â are advantages of the
teachers' and the student's last samples under the same critic; M counts teachers:

    lead     L_k = J_T − J_S − √(e_T² + e_S²)
    β_k        = max(0, L_k) / (J_T − J_0) / M, at most 1/M; 0 where J_T − J_0 ≤ √(e_T² + e_0²),
                 and of the teacher that the student began as
    kept       = the highest max(0, 2·P(Â′ > Â) − 1) of the samples of teachers with β_k > 0: ζ is
                 that quantile
    phase      = instance, after an iteration of the student's own, while some β_k > 0, until one
                 kept nothing
    end        = for good, once every β was 0 two own iterations in a row, or evaluating the
                 students has cost what it may

So β is the share of a teacher's lead over a random policy that is left and more than chance,
whatever the signs of the returns. A teacher no better than the student teaches nothing, and what is
left is PPO. Each part may be automatic alone, with the end. Seeds that train side by side share the
phase and the end, not β and ζ.
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

    def __init__(
        self, untrained: np.ndarray, taught: Sequence[np.ndarray], *, start: int | None = None
    ) -> None:
        """Begin with returns before the first iteration.

        Args:
            untrained: of policies that know nothing, (S, E).
            taught: of each teacher, (S, E).
            start: which teacher's policy the students begin with; None of an untrained one.
        """
        self.random = mean_and_error(untrained)
        self.taught = np.stack([mean_and_error(returns) for returns in taught], 1)  # (2, M, S)
        self.start = start
        """Which teacher the students began as: it has no β."""
        self.student = self.evaluated = self.random if start is None else self.taught[:, start]
        self.quantiles = np.zeros((N_QUANTILES, len(untrained)))
        """Of Â in each student's last batch, (N_QUANTILES, S)."""
        self.leading: np.ndarray = np.ones((len(taught), len(untrained)), bool)
        """Whether a teacher was ahead of a student in the last own iteration, (M, S)."""
        self.share: np.ndarray | None = None
        """What was kept of the last teachers' samples, (S,)."""
        self.idle = 0
        """Own iterations in a row without any β."""
        self.steps = 0.0
        """Environment steps of a seed, on average, that evaluating the students has cost."""

    def add_evaluation(self, returns: np.ndarray, steps: float) -> None:
        """Add evaluated returns (S, E) of the students, which cost so many steps of a seed."""
        (before, error_before), (now, error) = self.evaluated, mean_and_error(returns)
        self.student = np.stack([(before + now) / 2, np.hypot(error_before, error) / 2])
        self.evaluated = np.stack([now, error])
        self.steps += steps

    def add_rollout(self, seeds: np.ndarray, returns: np.ndarray) -> None:
        """Add the returns of a rollout's episodes, (episodes,), and whose they are.

        A student without two of them stays as good as it was.
        """
        self.student = self.student.copy()
        for s in range(self.student.shape[1]):
            if (seeds == s).sum() > 1:
                self.student[:, s] = mean_and_error(returns[None, seeds == s])[:, 0]

    def add_advantages(self, samples: Samples) -> None:
        """Add the students' advantages, as the critic estimates them after its fit."""
        per_seed = zip(samples.advantages, samples.counts.tolist(), strict=True)
        levels = np.linspace(0, 1, N_QUANTILES)
        self.quantiles = np.stack([np.quantile(own[:n].numpy(), levels) for own, n in per_seed], 1)

    def betas(self) -> np.ndarray:
        """Return β_k of each teacher and student, (M, S); several teachers share 1."""
        (teachers, teachers_error), (own, own_error) = self.taught, self.student
        whole = teachers - self.random[0]  # the lead over an untrained policy
        lead = teachers - own - np.hypot(teachers_error, own_error)
        chance = np.hypot(teachers_error, self.random[1])
        leads = whole > chance + rounding(self.random[0])
        if self.start is not None:
            leads[self.start] = False
        with np.errstate(invalid="ignore", divide="ignore"):
            shares = np.where(leads, np.clip(lead / whole, 0, 1), 0.0)
        betas: np.ndarray = np.nan_to_num(shares) / len(teachers)
        return betas

    def add_betas(self, betas: np.ndarray) -> None:
        """Add which β an own iteration had, (M, S)."""
        self.leading = betas > 0
        self.idle = 0 if betas.any() else self.idle + 1

    def end(self) -> None:
        """End the transfer."""
        self.idle = PATIENCE

    @property
    def ended(self) -> bool:
        """Whether no β has been above 0 for some own iterations, or it was ended."""
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
        return bool(self.leading.any() and (self.share is None or self.share.any()))

    def state(self) -> dict[str, Tensor]:
        """Return all of it as tensors, for a checkpoint."""
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        arrays |= {"idle": np.array(self.idle), "steps": np.array(self.steps)}
        arrays["start"] = np.array(-1 if self.start is None else self.start)
        arrays["share"] = np.zeros(0) if self.share is None else self.share
        return {name: tensor(array) for name, array in arrays.items()}

    @classmethod
    def of_state(cls, state: Mapping[str, Tensor]) -> "Measurements":
        """Return the measurements that `state` described.

        Raises:
            KeyError: a tensor is missing.
        """
        arrays = {name: value.numpy() for name, value in state.items()}
        measurements = cls.__new__(cls)
        for name in _ARRAYS:
            setattr(measurements, name, arrays[name])
        measurements.idle, measurements.steps = int(arrays["idle"]), float(arrays["steps"])
        measurements.share = arrays["share"] if len(arrays["share"]) else None
        start = int(arrays["start"])
        measurements.start = None if start < 0 else start
        return measurements


_ARRAYS = ("random", "taught", "student", "evaluated", "quantiles", "leading")


def rounding(returns: np.ndarray) -> np.ndarray:
    """Return by how much equal returns may differ, as sums in another order do."""
    size: np.ndarray = np.abs(returns) * 1e-9
    return size


def mean_and_error(rows: np.ndarray) -> np.ndarray:
    """Return each row's mean and its standard error, (2, S), of (S, E); `UNKNOWN` of one number."""
    n = rows.shape[1]
    if n < 2:
        return np.stack([rows.mean(1) if n else np.zeros(len(rows)), np.full(len(rows), UNKNOWN)])
    return np.stack([rows.mean(1), rows.std(1, ddof=1) / np.sqrt(n)])
