"""One number over several pairs of task and teacher, with its interval: rliable's aggregates.

Scores are normalised, pair by pair, by the reference of that pair: 0 is its first evaluation and 1
where it converged. Intervals are percentiles of a bootstrap that draws seeds within each pair
(Agarwal and others 2021); with few pairs and seeds they are too narrow, like every bootstrap.

**P** pairs · **S** seeds of one of them.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import scipy  # whose parts are loaded when first used
from numpy.typing import ArrayLike

from repaint_cli.report.statistics import RESAMPLES, Estimate, Floats, first_and_converged

Scores = Sequence[Floats]
"""Of each pair its seeds' scores, P of (…, S); pairs may have different numbers of seeds."""

Aggregate = Callable[[Scores], Floats]
"""From P of (…, S) to (…)."""

DRAWS = RESAMPLES // 2


def normalised(values: ArrayLike, reference: ArrayLike) -> Floats:
    """Return scores as shares of the way from a reference's first evaluation to where it converged.

    Args:
        values: returns of seeds, (S,).
        reference: evaluated mean returns of the reference, (S′, K).

    Raises:
        ValueError: the reference ended no higher than it began.
    """
    ends = first_and_converged(reference)
    if ends is None:
        raise ValueError("expected a reference that learned, found one that ended no higher")
    first, last = ends
    return (np.asarray(values, np.float64) - first) / (last - first)


def mean(scores: Scores) -> Floats:
    """Return the mean over pairs of the mean over seeds."""
    return np.asarray(np.mean([pair.mean(axis=-1) for pair in scores], axis=0))


def interquartile_mean(scores: Scores) -> Floats:
    """Return the mean of the middle half of all seeds of all pairs."""
    return np.asarray(scipy.stats.trim_mean(np.concatenate(scores, axis=-1), 0.25, axis=-1))


def optimality_gap(scores: Scores) -> Floats:
    """Return by how much seeds fall short of 1 on average; above 1 there is nothing to gain."""
    return np.asarray(1 - mean([np.minimum(pair, 1) for pair in scores]))


def probability_of_improvement(scores: Scores, others: Scores) -> Floats:
    """Return the mean over pairs of P(X > Y), seeds that are alike counting half."""
    above = [
        np.sign(own[..., :, None] - basis[..., None, :]).mean(axis=(-2, -1))
        for own, basis in zip(scores, others, strict=True)
    ]
    return np.asarray((1 + np.mean(above, axis=0)) / 2)


AGGREGATES: Mapping[str, Aggregate] = {
    "iqm": interquartile_mean, "mean": mean, "optimality_gap": optimality_gap,
}  # fmt: skip
"""By the names that they have in files."""


def interval_of(aggregate: Aggregate, scores: Scores, seed: int = 0) -> Estimate:
    """Return an aggregate and its 95 % interval, seeds drawn with replacement within each pair."""
    drawn = _drawn(scores, np.random.default_rng(seed))
    return _with_ends(aggregate(scores), aggregate(drawn))


def improvement(scores: Scores, others: Scores, seed: int = 0) -> Estimate:
    """Return the probability of improvement and its 95 % interval, both sides drawn anew."""
    rng = np.random.default_rng(seed)
    drawn = probability_of_improvement(_drawn(scores, rng), _drawn(others, rng))
    return _with_ends(probability_of_improvement(scores, others), drawn)


def _drawn(scores: Scores, rng: np.random.Generator) -> list[Floats]:
    return [pair[rng.integers(len(pair), size=(DRAWS, len(pair)))] for pair in scores]


def _with_ends(number: Floats, resampled: Floats) -> Estimate:
    low, high = np.percentile(resampled, [2.5, 97.5])
    return float(number), float(low), float(high)
