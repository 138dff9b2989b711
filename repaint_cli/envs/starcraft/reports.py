"""What is told of N games beside their pictures: scaled measurements, reward terms and records.

**N** environments · **F** reward terms.
"""

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.starcraft.names import SUMS
from repaint_cli.envs.starcraft.rts.constants import (
    LOOPS_PER_SECOND,
    LOOPS_PER_STEP,
    MEASUREMENTS,
    TERMS,
)

Floats = NDArray[np.float64]

USED_UP = np.array([200, 200, 64, 200], np.float32)
"""What food used, food there is, SCVs and marines are divided by."""


def scaled(measurements: NDArray[np.int32]) -> NDArray[np.float32]:
    """Return measurements (N, 5) at about 0 to 1; of minerals the logarithm, (N, 5)."""
    numbers = measurements.astype(np.float32)
    numbers[:, 0] = np.log1p(numbers[:, 0]) / 8
    numbers[:, 1:] /= USED_UP
    return numbers


class Reports:
    """Counts what happened in each of N games since its episode began."""

    def __init__(self, n_envs: int) -> None:
        self._sums, self._steps = np.zeros((n_envs, len(TERMS))), np.zeros(n_envs)

    def begin(self, rows: NDArray[np.intp]) -> None:
        """Count from 0 in these environments (K,)."""
        self._sums[rows], self._steps[rows] = 0, 0

    def passed(self, rows: NDArray[np.bool_]) -> None:
        """Count a step of these environments (N,)."""
        self._steps += rows

    def __call__(
        self, terms: Floats, measurements: NDArray[np.int32], mined: NDArray[np.int32]
    ) -> dict[str, Floats]:
        """Return the infos of a step, by name: new arrays (N,).

        Args:
            terms: what was counted in it, (N, F).
            measurements: what is so now, (N, 5), see `constants.MEASUREMENTS`.
            mined: minerals that were mined since the episode began, (N,).
        """
        self._sums += terms
        infos = {name: terms[:, i].copy() for i, name in enumerate(TERMS)}
        for i, name in enumerate(MEASUREMENTS):
            infos[name] = measurements[:, i].astype(np.float64)
        for name in SUMS:
            infos[f"sum_{name}"] = self._sums[:, TERMS.index(name)].copy()
        infos["minerals_mined"] = mined.astype(np.float64)
        infos["seconds"] = self._steps * LOOPS_PER_STEP / LOOPS_PER_SECOND
        return infos
