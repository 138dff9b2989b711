"""What cars sweep of the ground, on a grid: how many episodes passed a cell, and how. SI."""

import numpy as np

from repaint_cli.envs.racer.road import CAR_WIDTH
from repaint_cli.statistics import Floats

FINEST = 0.01
"""Least edge of a cell, m."""
MAX_CELLS = 500_000


def cell_of(low: Floats, high: Floats) -> float:
    """Return the edge of the cells between two corners (2,), m: coarser for a large field."""
    return max(FINEST, float(np.sqrt(np.prod(high - low) / MAX_CELLS)))


def sweep(xy: Floats, values: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Drive cars as wide as the racer's over a grid.

    Args:
        xy: where they were, (E, T, 2), m; nan after an episode's end.
        values: what each step counts for, (E, T).
        low: the grid's lower left corner, (2,), m.
        high: its upper right corner, (2,), m.

    Returns:
        episodes that passed over each cell, and the mean of their values there, nan where none did,
        each (rows by y, columns by x).
    """
    cell = cell_of(low, high)
    columns, rows = np.ceil((high - low) / cell).astype(int)
    passed, total = np.zeros(rows * columns), np.zeros(rows * columns)
    for path, worth in zip(xy, values, strict=True):
        points, weights = _carpet(path[np.isfinite(path).all(1)], worth, cell)
        cells = np.floor((points - low) / cell).astype(int)
        inside = ((cells >= 0) & (cells < [columns, rows])).all(1)
        at = cells[inside, 1] * columns + cells[inside, 0]
        hits = np.bincount(at, minlength=len(passed))
        sums = np.bincount(at, weights[inside], minlength=len(passed))
        passed += hits > 0
        total += np.where(hits > 0, sums / np.maximum(hits, 1), 0.0)
    means = np.where(passed > 0, total / np.maximum(passed, 1), np.nan)
    return passed.reshape(rows, columns), means.reshape(rows, columns)


def _carpet(path: Floats, values: Floats, cell: float) -> tuple[Floats, Floats]:
    """Return points that cover a car's way (T, 2) densely, (P, 2), and their values, (P,)."""
    if len(path) < 2:
        return np.empty((0, 2)), np.empty(0)
    ways = np.gradient(path, axis=0)
    aside = np.stack([-ways[:, 1], ways[:, 0]], axis=1)
    aside /= np.maximum(np.hypot(*aside.T), 1e-9)[:, None]
    longest = float(np.hypot(*np.diff(path, axis=0).T).max())
    shares = np.linspace(0, 1, 1 + int(np.ceil(1.5 * longest / cell)))[:, None, None]
    across = np.linspace(-0.5, 0.5, int(np.ceil(1.5 * CAR_WIDTH / cell)))[:, None, None, None]

    def between(ends: Floats) -> Floats:
        return ends[:-1] + shares * (ends[1:] - ends[:-1])  # (shares, T−1, 2)

    points = between(path) + across * CAR_WIDTH * between(aside)  # (across, shares, T−1, 2)
    worth = np.broadcast_to(values[1 : len(path)], points.shape[:-1])
    return points.reshape(-1, 2), worth.reshape(-1)
