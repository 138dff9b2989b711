"""Few runs, honest numbers: means with bootstrap intervals, and the numbers of a transfer report.

Pure numpy and deterministic. `nan` means "no value": a number over runs is nan as soon as one of
them has none, because a mean over only the runs that got there would flatter.

**R** runs · **S** seeds · **K** iterations, numbered from 1.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

RESAMPLES = 10_000


def mean_ci(values: ArrayLike, level: float = 0.95, seed: int = 0) -> tuple[float, float, float]:
    """Return the mean over runs and its percentile bootstrap interval.

    Args:
        values: one number a run, (R,).
        level: what share of the resampled means the interval holds.
        seed: of the resampling; the same seed gives the same interval.

    Returns:
        mean, low, high. With one run low and high are nan: one run says nothing about spread.
    """
    runs = _vector(values)
    if len(runs) == 0 or np.isnan(runs).any():
        return np.nan, np.nan, np.nan
    low, high = bootstrap_mean(runs[:, None], level, seed)
    return float(runs.mean()), float(low[0]), float(high[0])


def bootstrap_mean(values: Floats, level: float = 0.95, seed: int = 0) -> tuple[Floats, Floats]:
    """Return the percentile bootstrap interval of the mean over runs, column by column.

    Runs are drawn with replacement, whole rows at a time, so a curve keeps its shape.

    Args:
        values: one row a run, (R, K); nan spreads over its column only.
        level: what share of the resampled means the interval holds.
        seed: of the resampling.

    Returns:
        low and high, each (K,); nan with fewer than two runs.
    """
    n_runs, n_columns = values.shape
    if n_runs < 2:
        return np.full(n_columns, np.nan), np.full(n_columns, np.nan)
    generator = np.random.default_rng(seed)
    drawn = generator.multinomial(n_runs, np.full(n_runs, 1 / n_runs), RESAMPLES)  # (RESAMPLES, R)
    low, high = np.full((2, n_columns), np.nan)
    known = ~np.isnan(values).any(axis=0)  # (K,)
    tails = [(1 - level) / 2, (1 + level) / 2]
    means = drawn @ values[:, known] / n_runs  # (RESAMPLES, known)
    low[known], high[known] = np.quantile(means, tails, axis=0)
    return low, high


def area_under_curve(returns: ArrayLike) -> Floats:
    """Return the area under each seed's learning curve, divided by its length: a mean return.

        AUC = Σᵢ (xᵢ₊₁ − xᵢ)(yᵢ + yᵢ₊₁)/2 / (x_last − x_first)      trapezoids

    Args:
        returns: evaluated mean returns, (S, K). Iterations at which no seed was evaluated (all
            nan) are left out; a seed that lacks one of the others has the area nan.

    Returns:
        In the unit of the return, (S,).
    """
    curves = _matrix(returns)
    iterations = np.flatnonzero(~np.isnan(curves).all(axis=0))
    if len(iterations) == 0:
        return np.full(len(curves), np.nan)
    known = curves[:, iterations]
    if len(iterations) == 1:
        return known[:, 0].copy()
    span = iterations[-1] - iterations[0]
    return np.asarray(np.trapezoid(known, iterations, axis=1) / span, dtype=np.float64)


def iterations_to(returns: ArrayLike, target: float) -> Floats:
    """Return the first iteration, from 1, whose evaluated mean return is at least `target`.

    Args:
        returns: evaluated mean returns, (S, K); nan where not evaluated.
        target: in the unit of the return.

    Returns:
        (S,), nan for a seed that never gets there.
    """
    reached = _matrix(returns) >= target  # (S, K), False at nan
    if reached.shape[1] == 0:
        return np.full(len(reached), np.nan)
    return np.where(reached.any(axis=1), reached.argmax(axis=1) + 1.0, np.nan)


def _vector(values: ArrayLike) -> Floats:
    return np.asarray(values, dtype=np.float64).reshape(-1)


def _matrix(values: ArrayLike) -> Floats:
    matrix = np.asarray(values, dtype=np.float64)
    if matrix.ndim != 2:
        raise ValueError(f"returns must be (seeds, iterations), got the shape {matrix.shape}")
    return matrix
