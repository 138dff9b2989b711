"""How far a rollout goes: so many steps of a seed or of an environment, or one episode each."""

import numpy as np

from repaint_cli.activity import progress


class Extent:
    """How far a rollout goes; see `collect.collect` for the three kinds."""

    def __init__(
        self, shape: tuple[int, int], n_steps: int | None, whole: bool, each_steps: int | None
    ) -> None:
        self.running = np.ones(shape, bool)
        """Which environments go on, (S, N)."""
        self._n_steps, self._whole, self._left = n_steps, whole, each_steps
        self._taken = np.zeros(shape[0], int)

    def valid(self, resetting: np.ndarray) -> np.ndarray:
        """Return whose next step counts, (S, N): no more than the seed still needs."""
        valid: np.ndarray = self.running & ~resetting
        if self._n_steps is not None and not self._whole:
            valid &= valid.cumsum(1) + self._taken[:, None] <= self._n_steps
        return valid

    def advance(self, valid: np.ndarray, ended: np.ndarray) -> None:
        """Count a step; `ended` says whose episode it ended, (S, N)."""
        self._taken += valid.sum(1)
        if self._left is not None:
            self._left -= 1
            self.running &= self._left > 0
        elif self._n_steps is None:
            self.running &= ~ended
        elif self._whole:  # no environment begins another episode once its seed has enough
            self.running &= ~((ended | ~valid) & (self._taken >= self._n_steps)[:, None])
        elif (self._taken >= self._n_steps).all():
            self.running[:] = False
        self._say_progress()

    def _say_progress(self) -> None:
        taken, size = int(self._taken.sum()), self.running.size
        if self._left is not None:
            progress(taken, taken + self._left * size, "steps")
        elif self._n_steps is not None:
            progress(taken, self._n_steps * len(self._taken), "steps")
        else:
            progress(size - int(self.running.sum()), size, "episodes")
