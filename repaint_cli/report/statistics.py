"""Few runs, honest numbers: means with their intervals, and the numbers of a learning curve.

Deterministic, on numpy and scipy. `nan` means "no value": a number over runs is nan as soon
as one of them has none, because a mean over only the runs that got there would be too good.
Seeds, which are few, have t intervals; episodes, which are many, a bootstrap.

**R** runs · **S** seeds · **K** iterations, numbered from 1.
"""

import numpy as np
import scipy  # whose parts are loaded when first used
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

Estimate = tuple[float, float, float]
"""A number and the ends of its 95 % interval, nan where there is none."""

RESAMPLES = 10_000
FAR, LEAST_OF_OUTLIERS = 10.0, 5
"""How far a number lies from the others, in standard deviations, and of how many."""

AT_ONCE = 500
"""Resamples that lie in memory together."""


def mean_ci(values: ArrayLike, level: float = 0.95, seed: int = 0) -> tuple[float, float, float]:
    """Return the mean over runs and its percentile bootstrap interval.

    For many runs, such as episodes; `mean_of` is for few.

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
        resampled = scipy.stats.bootstrap(
            (values[:, known],), np.mean, axis=0, n_resamples=RESAMPLES, batch=AT_ONCE,
            confidence_level=level, method="percentile", rng=np.random.default_rng(seed),
        )  # fmt: skip
        low[known], high[known] = resampled.confidence_interval
    return low, high


def student_t(level: float, freedom: ArrayLike) -> Floats:
    """Return t's quantiles, (…): `scipy.stats.t.ppf` without `scipy.stats`, long to load."""
    return np.asarray(scipy.special.stdtrit(freedom, level))


def t_interval(values: ArrayLike, level: float = 0.95) -> tuple[Floats, Floats, Floats]:
    """Return the mean over runs and Student's interval of it, column by column.

        mean ± t(R − 1) · s / √R

    With few runs it is wider than a bootstrap's, and holds what it says (docs/comparing.md).

    Args:
        values: one row a run, (R, …); nan spreads over its column only.
        level: how often such an interval holds the mean.

    Returns:
        mean, low and high, each (…); the ends are nan with fewer than two runs.
    """
    runs = np.asarray(values, dtype=np.float64)
    n = len(runs)
    mean = runs.mean(axis=0) if n else np.full(runs.shape[1:], np.nan)
    if n < 2:
        return mean, np.full_like(mean, np.nan), np.full_like(mean, np.nan)
    wide = student_t((1 + level) / 2, n - 1) * runs.std(axis=0, ddof=1) / np.sqrt(n)
    return mean, mean - wide, mean + wide


def mean_of(values: ArrayLike) -> Estimate:
    """Return the mean of one number a run, (R,), and its 95 % t interval."""
    mean, low, high = t_interval(_vector(values))
    return float(mean), float(low), float(high)


def trims(n_runs: int) -> int:
    """Return how many runs at each end an interquartile mean leaves out; with three it is none."""
    return n_runs // 4


def interquartile_mean(values: ArrayLike) -> float:
    """Return the mean of the middle half of the runs (R,): one outlier moves it less."""
    runs = np.sort(_vector(values))
    if not trims(len(runs)):
        return float(runs.mean()) if len(runs) else float("nan")
    return float(scipy.stats.trim_mean(runs, 0.25))


def interquartile_mean_of(values: ArrayLike, level: float = 0.95) -> Estimate:
    """Return the interquartile mean over runs, (R,), and its interval after Tukey and McLaughlin.

        IQM ± t(h − 1) · s_w / ((h / R) √R)      h runs are left, s_w is of the winsorised ones

    Where nothing is left out, below four runs, it is the mean and Student's interval.
    """
    runs = np.sort(_vector(values))
    n, cut = len(runs), trims(len(runs))
    middle = interquartile_mean(runs)
    if n < 2 or np.isnan(runs).any():
        return middle, np.nan, np.nan
    left = n - 2 * cut
    winsorised = np.clip(runs, runs[cut], runs[n - 1 - cut])
    error = winsorised.std(ddof=1) * np.sqrt(n) / left
    wide = float(student_t((1 + level) / 2, left - 1) * error)
    return middle, middle - wide, middle + wide


def far_off(values: ArrayLike) -> NDArray[np.bool_]:
    """Return which of some numbers lie far from the others, (R,): such seeds have run away.

        |xᵢ − m| > 10·1.4826·median |xⱼ − m|,   m the median

    That is ten standard deviations of the others, if these are normal. Fewer than 5 show none.
    """
    numbers = _vector(values)
    if len(numbers) < LEAST_OF_OUTLIERS or np.isnan(numbers).any():
        return np.zeros(len(numbers), np.bool_)
    gaps = np.abs(numbers - np.median(numbers))
    spread = 1.4826 * np.median(gaps)
    return np.asarray((gaps > FAR * spread) & (spread > 0))


def iteration_of_mean(returns: ArrayLike, target: float) -> float:
    """Return the first iteration, from 1, at which the seeds' mean is at least `target`, or nan."""
    return float(iterations_to(_matrix(returns).mean(axis=0, keepdims=True), target)[0])


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


def area_by_steps(returns: ArrayLike, steps: ArrayLike, low: float, high: float) -> Floats:
    """Return the area under each seed's curve over its environment steps, from `low` to `high`.

    Curves are straight between evaluations, and the area is divided by high − low: a mean return.

    Args:
        returns: evaluated mean returns, (S, K).
        steps: environment steps that a seed had taken at each of them, (S, K), ascending.
        low: where the common range of steps begins.
        high: where it ends.

    Returns:
        In the unit of the return, (S,); nan where the range is empty or a step is not known.
    """
    areas = [
        _area_between(curve, at, low, high)
        for curve, at in zip(_matrix(returns), _matrix(steps), strict=True)
    ]
    return np.array(areas, dtype=np.float64)


def _area_between(curve: Floats, at: Floats, low: float, high: float) -> float:
    if not low < high or np.isnan([*curve, *at]).any():
        return float("nan")
    inside = at[(low < at) & (at < high)]
    points = np.concatenate([[low], inside, [high]])
    return float(np.trapezoid(np.interp(points, at, curve), points) / (high - low))


def converged_score(returns: ArrayLike) -> float:
    """Return the mean of the last fifth of the seeds' mean curve, (S, K): where it came to rest."""
    mean = _matrix(returns).mean(axis=0)
    return float(mean[-max(1, len(mean) // 5) :].mean())


def first_and_converged(returns: ArrayLike) -> tuple[float, float] | None:
    """Return a run's first mean return and its converged score; None where it rose no higher."""
    curves = _matrix(returns)
    first, last = float(curves[:, 0].mean()), converged_score(curves)
    return (first, last) if first < last else None


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
