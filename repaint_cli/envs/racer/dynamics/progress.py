"""How far cars have come in their episodes, and how long they are in trouble.

Progress is a percentage of the lap since the start; the other units are SI.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.track.geometry import Floats
from repaint_cli.kernels import kernel

STILL = 0.0003
"""A base that moves no further than this in a step has not moved, m."""


@kernel
def progress_one(ndist: float, start_ndist: float, previous: float) -> float:
    """Return one car's progress, percent; see `progress_since`."""
    progress = 100 * (ndist - start_ndist)
    if progress <= 0:
        progress += 100
    if previous > progress + 50:
        progress += 100
    if progress > previous + 50:
        progress -= 100
    return min(progress, 100.0)


@kernel
def _progress_rows(
    ndist: np.ndarray, start_ndist: np.ndarray, previous: np.ndarray, progress: np.ndarray
) -> None:
    for k in range(len(progress)):
        progress[k] = progress_one(ndist[k], start_ndist[k], previous[k])


def progress_since(ndist: Floats, start_ndist: Floats, previous: Floats) -> Floats:
    """Return the percentage of the lap driven since the start, (N,), at most 100.

    The lap fraction jumps at the start line and is ambiguous behind the start; of the candidates a
    lap apart the result is the one within half a lap of the previous progress. It is negative for a
    car behind its start.

    Args:
        ndist: lap fraction of the front point, (N,).
        start_ndist: lap fraction of the episode's start, (N,).
        previous: progress one step ago, (N,); 0 before the first.
    """
    progress = np.empty(len(ndist))
    _progress_rows(ndist, start_ndist, previous, progress)
    return progress


@kernel
def count_one(
    moved: float, gained: float, steps: int, still: int, backwards: int
) -> tuple[int, int, int]:
    """Return one car's counters after a step that moved it (m) and gained progress (percent)."""
    return steps + 1, still + 1 if moved <= STILL else 0, backwards + 1 if gained < 0 else 0


@kernel
def _count_rows(
    rows: np.ndarray, moved: np.ndarray, gained: np.ndarray, steps: np.ndarray,
    still: np.ndarray, backwards: np.ndarray,
) -> None:  # fmt: skip
    for k, row in enumerate(rows):
        steps[row], still[row], backwards[row] = count_one(
            moved[k], gained[k], steps[row], still[row], backwards[row]
        )


@dataclass
class Counters:
    """How long each car has been in trouble, and on the road."""

    steps: NDArray[np.int64]
    """Steps of this episode, (N,)."""
    still: NDArray[np.int64]
    """Steps in a row without movement, (N,)."""
    backwards: NDArray[np.int64]
    """Steps in a row with falling progress, (N,)."""

    @classmethod
    def zeros(cls, n: int) -> "Counters":
        """Make the counters of N cars."""
        return cls(*(np.zeros(n, dtype=np.int64) for _ in range(3)))

    def clear(self, rows: NDArray[np.int64]) -> None:
        """Start new episodes in these rows, (K,)."""
        for counter in (self.steps, self.still, self.backwards):
            counter[rows] = 0

    def clear_trouble(self, rows: NDArray[np.int64]) -> None:
        """Let these rows (K,) go on in their episodes as if they had moved."""
        for counter in (self.still, self.backwards):
            counter[rows] = 0

    def count(self, rows: NDArray[np.int64], moved: Floats, gained: Floats) -> None:
        """Count a step of rows (K,): how far each base moved (K,), m; progress gained (K,)."""
        _count_rows(rows, moved, gained, self.steps, self.still, self.backwards)
