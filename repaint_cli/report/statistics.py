"""Few runs, honest numbers: means with bootstrap intervals, and the numbers of a transfer report.

Deterministic, on numpy and `scipy.stats`. `nan` means "no value": a number over runs is nan as soon
as one of them has none, because a mean over only the runs that got there would be too good.

**R** runs · **S** seeds · **K** iterations, numbered from 1.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

Floats = NDArray[np.float64]

RESAMPLES = 10_000
AT_ONCE = 500
"""Resamples that lie in memory together."""
NUMBERS_AT_ONCE = 10_000_000
"""Numbers of resampled curves that lie in memory together."""


def mean_ci(values: ArrayLike, level: float = 0.95, seed: int = 0) -> tuple[float, float, float]:
    """Return the mean over runs and its percentile bootstrap interval.

    Args:
        values: one number a run, (R,).
        level: what share of the resampled means the interval holds.
        seed: of the resampling; the same seed gives the same interval.

    Returns:
        mean, low, high. With one run low and high are nan: one run does not show spread.
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
    low, high = np.full((2, n_columns), np.nan)
    known = ~np.isnan(values).any(axis=0)  # (K,)
    if known.any():
        resampled = stats.bootstrap(
            (values[:, known],), np.mean, axis=0, n_resamples=RESAMPLES, batch=AT_ONCE,
            confidence_level=level, method="percentile", rng=np.random.default_rng(seed),
        )  # fmt: skip
        low[known], high[known] = resampled.confidence_interval
    return low, high


def interquartile_mean(values: ArrayLike) -> float:
    """Return the mean of the middle half of the runs (R,): one outlier moves it less."""
    runs = _vector(values)
    return float(stats.trim_mean(runs, 0.25)) if len(runs) else float("nan")


def iqm_ci(values: ArrayLike, level: float = 0.95, seed: int = 0) -> tuple[float, float, float]:
    """Return the interquartile mean over runs (R,) and its percentile bootstrap interval."""
    runs = _vector(values)
    if len(runs) < 2 or np.isnan(runs).any():
        return interquartile_mean(runs), np.nan, np.nan
    resampled = stats.bootstrap(
        (runs,), lambda x, axis: stats.trim_mean(x, 0.25, axis), n_resamples=RESAMPLES,
        confidence_level=level, method="percentile", rng=np.random.default_rng(seed),
    )  # fmt: skip
    low, high = resampled.confidence_interval
    return interquartile_mean(runs), float(low), float(high)


def differ_by_chance(values: ArrayLike, others: ArrayLike, seed: int = 0) -> float:
    """Return how often runs of one kind, split at random, differ as much in their means: p.

    A permutation test of two sides, exact where there are few splits; nan where there is one.

    Args:
        values: one number a run, (R,).
        others: the same of the other kind, (R′,).
        seed: of the splits, where there are more than 10,000.
    """
    both = _vector(values), _vector(others)
    if min(len(runs) for runs in both) < 2 or any(np.isnan(runs).any() for runs in both):
        return float("nan")

    def gap(one: Floats, other: Floats, axis: int) -> Floats:
        return np.asarray(one.mean(axis) - other.mean(axis))

    test = stats.permutation_test(
        both, gap, vectorized=True, n_resamples=RESAMPLES, rng=np.random.default_rng(seed)
    )
    return float(test.pvalue)


def iteration_of_mean(returns: ArrayLike, target: float) -> float:
    """Return the first iteration, from 1, at which the seeds' mean is at least `target`, or nan."""
    return float(iterations_to(_matrix(returns).mean(axis=0, keepdims=True), target)[0])


def reduction_ci(
    returns: ArrayLike, reference: ArrayLike, target: float, level: float = 0.95, seed: int = 0
) -> tuple[float, float, float]:
    """Return 1 − K / K_ref and its percentile bootstrap interval, nan where one never gets there.

    K and K_ref are the iterations at which the means over seeds reach the target (paper, table 1).
    Seeds are drawn with replacement; a mean drawn so that never gets there counts as one iteration
    more than there are.

    Args:
        returns: evaluated mean returns, (S, K).
        reference: the same of the run it is compared with, (S′, K′).
        target: in the unit of the return.
        level: what share of the resampled numbers the interval holds.
        seed: of the resampling.
    """
    own, others = _matrix(returns), _matrix(reference)

    def reduced(rows: NDArray[np.int64], other_rows: NDArray[np.int64], axis: int) -> Floats:
        """Return the number for seeds drawn (…, S) and (…, S′), axis the last."""
        reached = [
            _reached(curves[drawn].mean(axis - 1), target)
            for curves, drawn in ((own, rows), (others, other_rows))
        ]
        return np.asarray(1 - reached[0] / reached[1])

    if np.isnan([iteration_of_mean(own, target), iteration_of_mean(others, target)]).any():
        return np.nan, np.nan, np.nan
    seeds = np.arange(len(own)), np.arange(len(others))
    mean = float(reduced(*seeds, -1))
    if min(len(own), len(others)) < 2:
        return mean, np.nan, np.nan
    resampled = stats.bootstrap(
        seeds, reduced, vectorized=True, n_resamples=RESAMPLES // 10, confidence_level=level,
        batch=max(1, min(RESAMPLES // 10, NUMBERS_AT_ONCE // max(own.size, others.size))),
        method="percentile", rng=np.random.default_rng(seed),
    )  # fmt: skip
    low, high = resampled.confidence_interval
    return mean, float(low), float(high)


def _reached(means: Floats, target: float) -> Floats:
    """Return the first iteration at the target of mean curves (…, K); K + 1 where there is none."""
    reached = means >= target
    first = reached.argmax(axis=-1) + 1
    return np.asarray(np.where(reached.any(axis=-1), first, means.shape[-1] + 1), np.float64)


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
