"""When runs reach a target, of which some never do: these are censored at the last iteration.

**n** seeds · **H** the last iteration, from which on nobody looked.
"""

import numpy as np
from numpy.typing import ArrayLike

from repaint_cli.report.pairs import permutation_p
from repaint_cli.report.statistics import Floats, first_and_converged, iteration_of_mean

SHARES = (0.25, 0.5, 0.75, 0.9, 1.0)
"""Of the way from the reference's first evaluation to its converged score: the usual targets."""


def usual_targets(returns: ArrayLike) -> dict[float, float]:
    """Return targets by their share of the way from a run's first evaluation to where it converged.

    None where the run, (S, K), ended no higher than it began.
    """
    ends = first_and_converged(returns)
    if ends is None:
        return {}
    first, last = ends
    return {share: first + share * (last - first) for share in SHARES}


def restricted(reached: ArrayLike, horizon: int) -> Floats:
    """Return min(K, H) of each seed, (n,); nan in `reached` is a seed that had not arrived by H.

    All seeds are watched until H, so its mean is the area under the Kaplan-Meier curve up to H: the
    mean number of iterations, of the first H, that a seed needed.
    """
    times = np.asarray(reached, np.float64)
    return np.where(np.isnan(times), float(horizon), times)


def logrank_scores(reached: ArrayLike, others: ArrayLike) -> tuple[Floats, Floats]:
    """Return the log-rank score of each seed of two runs, (n,) and (n′,).

        1{arrived} − Σ_{t ≤ K} d(t) / r(t)      d arrive at t, of r that had not before

    The sum over a run's seeds is what the log-rank test calls observed less expected.
    """
    own, basis = np.asarray(reached, np.float64), np.asarray(others, np.float64)
    both = np.concatenate([own, basis])
    at = np.where(np.isnan(both), np.inf, both)
    arrivals = np.unique(at[np.isfinite(at)])
    hazard = np.array([(at == t).sum() / (at >= t).sum() for t in arrivals])
    scores = np.isfinite(at) - np.array([hazard[arrivals <= t].sum() for t in at])
    return scores[: len(own)], scores[len(own) :]


def logrank_p(reached: ArrayLike, others: ArrayLike) -> float:
    """Return p of the log-rank test of two runs' arrivals, by permutation: exact with few seeds.

    nan where nobody arrives, or a run has fewer than two seeds.
    """
    arrived = ~np.isnan(np.concatenate([np.asarray(reached), np.asarray(others)], dtype=float))
    if not arrived.any():
        return float("nan")
    return permutation_p(*logrank_scores(reached, others))


def saved(returns: ArrayLike, reference: ArrayLike, target: float) -> float:
    """Return 1 − K / K_ref, the paper's measure: K is when the seeds' mean is first at the target.

    nan where one of the two, (S, K) and (S′, K′), never gets there.
    """
    own, basis = (iteration_of_mean(curves, target) for curves in (returns, reference))
    return 1 - own / basis
