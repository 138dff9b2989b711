"""Statistics of an iteration: the loops yield them, and metrics.csv holds them."""

from dataclasses import dataclass

import numpy as np

from repaint_cli.kernels import training_clock
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.transfer.schedules import Phase


@dataclass(frozen=True)
class IterationStats:
    """What one iteration did, a number per seed."""

    iteration: int
    """k, from 1."""
    phase: Phase
    """What the iteration was."""
    metrics: dict[str, np.ndarray]
    """The columns of metrics.csv, (S,) each."""
    rollout: Rollout | None = None
    """What the students did, without their observations; None where teachers acted alone."""
    steps: float = 0.0
    """Environment steps of a seed in it, on average."""


class Meter:
    """Counts the environment steps and the seconds of one iteration, from when it is made."""

    def __init__(self, learner: Learner) -> None:
        self._learner, self._before = learner, learner.env_steps.copy()
        self._started = training_clock()

    def stats(
        self, phase: Phase, metrics: dict[str, np.ndarray], rollout: Rollout | None
    ) -> IterationStats:
        """Return what the iteration did, which has ended.

        Args:
            phase: what it was.
            metrics: its losses and diagnostics, (S,) each.
            rollout: what the students did, if they acted.
        """
        seconds, learner = training_clock() - self._started, self._learner
        taken = learner.env_steps - self._before
        metrics = metrics | {
            "env_steps": learner.env_steps.copy(),
            "steps_per_second": np.full(taken.shape, taken.sum() / seconds),
        }
        return IterationStats(learner.iteration, phase, metrics, rollout, float(taken.mean()))
