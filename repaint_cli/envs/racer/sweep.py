"""The ground that cars drive over, on a grid: episodes per cell, and their mean values. SI."""

import numpy as np

from repaint_cli.envs.racer.road import CAR_WIDTH
from repaint_cli.envs.racer.track.geometry import Floats

FINEST = 0.01
"""Least edge of a cell, m."""
MAX_CELLS = 500_000


def cell_of(low: Floats, high: Floats) -> float:
    """Return the edge of the cells between two corners (2,), m: coarser for a large field."""
    return max(FINEST, float(np.sqrt(np.prod(high - low) / MAX_CELLS)))


def sweep(xy: Floats, values: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Count the episodes whose car, in its whole width, drove over each cell of a grid.

    Args:
        xy: positions, (E, T, 2), m; nan after an episode's end.
        values: of the steps, (E, T).
        low: the grid's lower left corner, (2,), m.
        high: its upper right corner, (2,), m.

    Returns:
        the number of episodes in each cell, and the mean of their values there, nan where there are
        none, each (rows by y, columns by x).
    """
    cell = cell_of(low, high)
    columns, rows = np.ceil((high - low) / cell).astype(int)
    passed, total = np.zeros(rows * columns), np.zeros(rows * columns)
    for path, path_values in zip(xy, values, strict=True):
        points, weights = _covering_points(path, path_values, cell)
        cells = np.floor((points - low) / cell).astype(int)
        inside = ((cells >= 0) & (cells < [columns, rows])).all(1)
        at = cells[inside, 1] * columns + cells[inside, 0]
        hits = np.bincount(at, minlength=len(passed))
        sums = np.bincount(at, weights[inside], minlength=len(passed))
        passed += hits > 0
        total += np.where(hits > 0, sums / np.maximum(hits, 1), 0.0)
    means = np.where(passed > 0, total / np.maximum(passed, 1), np.nan)
    return passed.reshape(rows, columns), means.reshape(rows, columns)


def _covering_points(path: Floats, values: Floats, cell: float) -> tuple[Floats, Floats]:
    """Return points that densely cover the ground under a car's path, (P, 2), and values, (P,).

    Args:
        path: of the car, (T, 2), m; nan where it is broken or at its end.
        values: of its steps, (T,).
        cell: edge of the grid's cells, m.
    """
    driven = np.isfinite(path).all(1)
    ends = np.flatnonzero(np.diff(driven)) + 1
    pieces = zip(np.split(path, ends), np.split(values, ends), strict=True)
    covered = [_covered(*piece, cell) for piece in pieces if np.isfinite(piece[0]).all()]
    points = np.concatenate([np.empty((0, 2)), *(own for own, _ in covered)])
    return points, np.concatenate([np.empty(0), *(own for _, own in covered)])


def _covered(path: Floats, values: Floats, cell: float) -> tuple[Floats, Floats]:
    """Return what `_covering_points` does for a path in one piece."""
    if len(path) < 2:
        return np.empty((0, 2)), np.empty(0)
    steps = np.gradient(path, axis=0)
    aside = np.stack([-steps[:, 1], steps[:, 0]], axis=1)
    aside /= np.maximum(np.hypot(*aside.T), 1e-9)[:, None]
    longest = float(np.hypot(*np.diff(path, axis=0).T).max())
    shares = np.linspace(0, 1, 1 + int(np.ceil(1.5 * longest / cell)))[:, None, None]
    across = np.linspace(-0.5, 0.5, int(np.ceil(1.5 * CAR_WIDTH / cell)))[:, None, None, None]

    def between(ends: Floats) -> Floats:
        return ends[:-1] + shares * (ends[1:] - ends[:-1])  # (shares, T−1, 2)

    points = between(path) + across * CAR_WIDTH * between(aside)  # (across, shares, T−1, 2)
    point_values = np.broadcast_to(values[1 : len(path)], points.shape[:-1])
    return points.reshape(-1, 2), point_values.reshape(-1)
