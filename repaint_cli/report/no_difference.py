"""What every number of a comparison is where there is nothing to find: one method against itself.

**S** seeds of one method · **R** pairs of groups drawn from them · **g** seeds of a group · **K**
iterations. Groups are indices of seeds, (R, 2, g): row 0 stands for the run, row 1 for the
reference.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from repaint_cli.report.pairs import welch_interval
from repaint_cli.report.statistics import Estimate, Floats

Groups = NDArray[np.int64]

DRAWS = 2_000
LEAST_SEEDS = 4
"""Seeds that make two groups of two."""


def halves(n_seeds: int, seed: int = 0) -> Groups:
    """Split seeds at random into two groups of n_seeds // 2, again and again: (R, 2, g)."""
    rng, g = np.random.default_rng(seed), n_seeds // 2
    orders = rng.permuted(np.tile(np.arange(n_seeds), (DRAWS, 1)), axis=1)
    return orders[:, : 2 * g].reshape(DRAWS, 2, g)


def drawn(n_seeds: int, group: int, seed: int = 0) -> Groups:
    """Draw two groups of seeds with replacement, again and again: (R, 2, g)."""
    return np.random.default_rng(seed).integers(n_seeds, size=(DRAWS, 2, group))


def never(values: Floats) -> float:
    """Return in which share of the pairs of groups there is no value, (R,)."""
    return float(np.isnan(values).mean())


def middle_and_ends(values: Floats) -> Estimate:
    """Return the mean of values, (R,), and between which ends 95 % of them lie."""
    known = values[~np.isnan(values)]
    if not len(known):
        return np.nan, np.nan, np.nan
    low, high = np.percentile(known, [2.5, 97.5])
    return float(known.mean()), float(low), float(high)


def gaps(values: ArrayLike, groups: Groups) -> Floats:
    """Return the difference of two groups' means of a number, (S,), for each pair: (R,)."""
    means = np.asarray(values, np.float64)[groups].mean(axis=2)
    return np.asarray(means[:, 0] - means[:, 1])


def reductions(returns: ArrayLike, groups: Groups, target: float | None = None) -> Floats:
    """Return 1 − K / K_ref by the paper's measure, (R,); nan where it is "not achieved".

    Args:
        returns: evaluated mean returns, (S, K).
        groups: pairs of groups of seeds.
        target: the return to reach; the best mean of the second group where absent.
    """
    curves = np.asarray(returns, np.float64)
    own, basis = (_share_of_each(groups[:, i], len(curves)) @ curves for i in (0, 1))
    goals = basis.max(axis=1) if target is None else np.full(len(groups), target)
    first, first_basis = (_first_at(means, goals) for means in (own, basis))
    return np.asarray(1 - first / first_basis)


def _share_of_each(group: Groups, n_seeds: int) -> Floats:
    """Return which share of a mean each seed is, (R, S), for groups (R, g)."""
    shares = np.zeros((len(group), n_seeds))
    np.add.at(shares, (np.arange(len(group))[:, None], group), 1 / group.shape[1])
    return shares


def _first_at(means: Floats, goals: Floats) -> Floats:
    reached = means >= goals[:, None] - 1e-9 * np.abs(goals[:, None])  # sums in another order
    return np.where(reached.any(axis=1), reached.argmax(axis=1) + 1.0, np.nan)


def chances(values: ArrayLike, groups: Groups) -> Floats:
    """Return P(X > Y) of two groups of a number, (S,), for each pair: (R,)."""
    numbers = np.asarray(values, np.float64)
    above = np.sign(numbers[:, None] - numbers[None, :])  # (S, S)
    pairs = above[groups[:, 0, :, None], groups[:, 1, None, :]]  # (R, g, g)
    return np.asarray((1 + pairs.mean(axis=(1, 2))) / 2)


def false_alarms(values: ArrayLike, groups: Groups) -> float:
    """Return in which share of the pairs Welch's 95 % interval of a number, (S,), leaves out 0."""
    numbers = np.asarray(values, np.float64)
    if np.isnan(numbers).any() or numbers.var() == 0:
        return float("nan")
    _, low, high = welch_interval(numbers[groups[:, 0]], numbers[groups[:, 1]])
    return float(((low > 0) | (high < 0)).mean())
