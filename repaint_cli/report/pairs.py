"""Is one method better than another? Differences, their tests, and what so few seeds can show.

Two runs share a seed's first weights and evaluation episodes, so their difference at each seed says
more than their means: where they share seeds, everything is about these differences.

**n** seeds.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb

import numpy as np
import scipy  # whose parts are loaded when first used
from numpy.typing import ArrayLike

from repaint_cli.report.statistics import RESAMPLES, Estimate, Floats, mean_of, student_t

NOTHING = (np.nan, np.nan, np.nan)

LEAST_PAIRS = 2
"""Seeds that two runs must share for their differences to be looked at."""

LEAST_SEEDS_NEEDED = {True: 6, False: 4}
"""With fewer, in pairs or in two groups, p cannot be below 0.05."""

MOST_SEEDS_NEEDED = 10_000
"""More are as good as endless."""


@dataclass(frozen=True)
class Difference:
    """How far one run lies above another in some number."""

    pairs: int
    """Seeds that both have, whose differences these are; 0 where the runs share none."""
    mean: Estimate
    """With the t interval of the paired differences, or Welch's of two means."""
    p: float
    """How often chance alone would give so large a difference."""
    smallest_p: float
    """The smallest value that p can have with so many seeds."""
    seeds_needed: float
    """About how many seeds would show such a difference: 80 % power at p = 0.05."""


def difference(
    values: ArrayLike, others: ArrayLike, seeds: Sequence[int], other_seeds: Sequence[int]
) -> Difference:
    """Return how far `values` lie above `others`, seed by seed where both have the same seeds.

    Args:
        values: one number a seed, (n,).
        others: the same of the run it is compared with, (n′,).
        seeds: the run seeds behind `values`.
        other_seeds: those behind `others`.
    """
    own, basis = np.asarray(values, np.float64), np.asarray(others, np.float64)
    shared = [seed for seed in seeds if seed in other_seeds]
    if len(shared) < LEAST_PAIRS:
        return _of_two(own, basis)
    own = own[[list(seeds).index(seed) for seed in shared]]
    basis = basis[[list(other_seeds).index(seed) for seed in shared]]
    return _of_pairs(own - basis)


def _of_pairs(gaps: Floats) -> Difference:
    spread = float(gaps.std(ddof=1))
    return Difference(
        pairs=len(gaps), mean=mean_of(gaps), p=sign_flip_p(gaps),
        smallest_p=_smallest(2.0 ** len(gaps)),
        seeds_needed=seeds_needed(_ratio(abs(gaps.mean()), spread)),
    )  # fmt: skip


def _of_two(own: Floats, basis: Floats) -> Difference:
    if min(len(own), len(basis)) < 2:
        gap = own.mean() - basis.mean() if min(len(own), len(basis)) else np.nan
        return Difference(0, (float(gap), np.nan, np.nan), np.nan, np.nan, np.nan)
    spread = float(np.sqrt((own.var(ddof=1) + basis.var(ddof=1)) / 2))
    return Difference(
        pairs=0, mean=welch(own, basis), p=permutation_p(own, basis),
        smallest_p=_smallest(comb(len(own) + len(basis), len(own))),
        seeds_needed=seeds_needed(_ratio(abs(own.mean() - basis.mean()), spread), paired=False),
    )  # fmt: skip


def _smallest(n_arrangements: float) -> float:
    """Return the smallest two-sided p among so many arrangements, or as many as are drawn."""
    return 2 / n_arrangements if n_arrangements <= RESAMPLES else 2 / (RESAMPLES + 1)


def _ratio(effect: float, spread: float) -> float:
    return float("inf") if spread == 0 and effect else effect / spread if effect else 0.0


def welch(values: ArrayLike, others: ArrayLike, level: float = 0.95) -> Estimate:
    """Return the difference of two means, (n,) and (n′,), and Welch's interval of it."""
    gap, low, high = welch_interval(values, others, level)
    return float(gap), float(low), float(high)


def welch_interval(
    values: ArrayLike, others: ArrayLike, level: float = 0.95
) -> tuple[Floats, Floats, Floats]:
    """Return differences of two means and Welch's intervals, for (…, n) and (…, n′): (…).

    gap ± t(ν) √(v + v′),  v = s²/n,  ν = (v + v′)² / (v²/(n − 1) + v′²/(n′ − 1))
    """
    own, basis = np.asarray(values, np.float64), np.asarray(others, np.float64)
    gap = np.asarray(own.mean(axis=-1) - basis.mean(axis=-1))
    n, m = own.shape[-1], basis.shape[-1]
    v, w = own.var(axis=-1, ddof=1) / n, basis.var(axis=-1, ddof=1) / m
    spread = v**2 / (n - 1) + w**2 / (m - 1)
    freedom = np.where(spread > 0, (v + w) ** 2 / np.where(spread > 0, spread, 1), 1)
    wide = student_t((1 + level) / 2, freedom) * np.sqrt(v + w)
    return gap, gap - wide, gap + wide


def sign_flip_p(gaps: ArrayLike) -> float:
    """Return how often paired differences, (n,), with signs at random have as large a mean: p.

    Of two sides; exact up to 13 pairs, then by 10,000 drawn signs.
    """
    return _p((np.asarray(gaps, np.float64),), lambda x, axis: x.mean(axis), "samples")


def permutation_p(values: ArrayLike, others: ArrayLike) -> float:
    """Return how often seeds, (n,) and (n′,), split at random differ as much in their means: p.

    Of two sides; exact up to 10,000 splits.
    """
    both = np.asarray(values, np.float64), np.asarray(others, np.float64)
    return _p(both, lambda x, y, axis: x.mean(axis) - y.mean(axis), "independent")


def _p(samples: tuple[Floats, ...], statistic: object, kind: str) -> float:
    if min(map(len, samples)) < 2 or any(np.isnan(sample).any() for sample in samples):
        return float("nan")
    test = scipy.stats.permutation_test(
        samples, statistic, vectorized=True, permutation_type=kind, n_resamples=RESAMPLES,
        rng=np.random.default_rng(0),
    )  # fmt: skip
    return float(test.pvalue)


def better(values: ArrayLike, others: ArrayLike) -> Estimate:
    """Return how probable it is that a seed of one run is above a seed of the other: P(X > Y).

    P = U / (n n′), the Mann-Whitney statistic; seeds that are alike count half. The 95 % interval
    holds the θ that are within t(n + n′ − 2) standard errors of P, where the error is that of θ
    (Newcombe 2006, method 5): so it exists where all seeds of one run are above all of the other.

        error² = θ(1 − θ) [1 + (N − 1)((1 − θ)/(2 − θ) + θ/(1 + θ))] / (n n′),   N = (n + n′)/2
    """
    own, basis = np.asarray(values, np.float64), np.asarray(others, np.float64)
    n, m = len(own), len(basis)
    if min(n, m) == 0 or np.isnan([*own, *basis]).any():
        return NOTHING
    gaps = np.sign(own[:, None] - basis[None, :])
    p = float((1 + gaps).mean() / 2)
    if min(n, m) < 2:
        return p, np.nan, np.nan
    t = float(student_t(0.975, n + m - 2))

    def beyond(theta: float) -> float:
        odds = (1 - theta) / (2 - theta) + theta / (1 + theta)
        error = theta * (1 - theta) * (1 + ((n + m) / 2 - 1) * odds) / (n * m)
        return float((p - theta) ** 2 - t**2 * error)

    inside = min(max(p, 1e-9), 1 - 1e-9)  # where P is 0 or 1 it is within its error of itself
    low = 0.0 if p == 0 else float(scipy.optimize.brentq(beyond, 0, inside))
    high = 1.0 if p == 1 else float(scipy.optimize.brentq(beyond, inside, 1))
    return p, low, high


def seeds_needed(effect: float, *, paired: bool = True) -> float:
    """Return about how many seeds a side show a difference with 80 % power at p = 0.05.

        n = (z₀.₉₇₅ + z₀.₈)² / d² + z₀.₉₇₅² / 2        paired; of two groups  2(…)² / d² + z² / 4

    Args:
        effect: d, the difference over its standard deviation (of the pairs, or of one run's seeds).
        paired: whether seeds are compared pair by pair.
    """
    if np.isnan(effect) or effect == 0:
        return float("nan")
    z, power = scipy.stats.norm.ppf([0.975, 0.8])
    sides = 1 if paired else 2
    n = float(sides * (z + power) ** 2 / effect**2 + z**2 / (2 * sides))
    if n > MOST_SEEDS_NEEDED:
        return float("inf")
    return float(max(LEAST_SEEDS_NEEDED[paired], np.ceil(n)))
