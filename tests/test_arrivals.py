"""When seeds reach a target, and what becomes of those that do not."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats

from repaint_cli.report.arrivals import (
    logrank_p,
    logrank_scores,
    restricted,
    saved,
    usual_targets,
)

NAN = np.nan


def censored(reached, horizon):
    """Arrivals as scipy takes them."""
    times = np.asarray(reached, float)
    late = np.isnan(times)
    return stats.CensoredData(uncensored=times[~late], right=np.full(late.sum(), horizon))


def test_the_restricted_mean_is_the_area_under_kaplan_and_meier():
    reached, horizon = [3.0, NAN, 7.0, 3.0, NAN, 9.0], 10
    curve = stats.ecdf(censored(reached, horizon)).sf
    ends = np.array([0, *curve.quantiles])
    heights = np.array([1.0, *curve.probabilities])
    area = (np.diff([*ends, horizon]) * heights).sum()
    assert restricted(reached, horizon).mean() == pytest.approx(area)
    assert_array_equal(restricted([NAN, NAN], 5), [5, 5])  # and not 6


def test_scores_are_observed_less_expected():
    own, others = [2.0, 4.0, NAN], [1.0, 2.0, 3.0, NAN]
    scores, other_scores = logrank_scores(own, others)
    # at 1: 1 of 7, 3 of them own; at 2: 2 of 6, 3 own; at 3: 1 of 4, 2 own; at 4: 1 of 3, 2 own
    expected = 3 / 7 + 2 * 3 / 6 + 2 / 4 + 2 / 3
    assert scores.sum() == pytest.approx(2 - expected)
    assert other_scores.sum() == pytest.approx(-scores.sum())


def test_the_test_agrees_with_scipy_where_there_are_many_seeds():
    rng = np.random.default_rng(4)
    own, others = (np.ceil(rng.exponential(scale, 60)) for scale in (8, 12))
    own[own > 20], others[others > 20] = NAN, NAN
    asymptotic = stats.logrank(censored(own, 20), censored(others, 20)).pvalue
    assert 0.01 < asymptotic < 0.5
    assert logrank_p(own, others) == pytest.approx(asymptotic, abs=0.03)


def test_with_few_seeds_p_is_not_below_what_their_splits_allow():
    early, late = [1.0, 1.0, 2.0], [NAN, NAN, NAN]
    assert logrank_p(early, late) == pytest.approx(2 / 20)
    assert stats.logrank(censored(early, 9), censored(late, 9)).pvalue < 0.05
    assert np.isnan(logrank_p([NAN, NAN], [NAN, NAN]))
    assert np.isnan(logrank_p([1.0], [2.0]))


def test_usual_targets_are_shares_of_the_way_to_where_the_reference_converged():
    mean = np.array([-10.0, -9.0, -8.0, -7.0, -6.0, -5.0, -4.0, -3.0, -2.2, -1.8])
    returns = np.stack([mean - 1, mean + 1])
    found = usual_targets(returns)
    assert list(found) == [0.25, 0.5, 0.75, 0.9, 1.0]
    assert_allclose(list(found.values()), -10 + 8 * np.array(list(found)))  # last fifth: -2
    assert usual_targets([[3.0, 2.0]]) == {}
    assert usual_targets([[3.0]]) == {}


def test_what_was_saved_is_nothing_where_one_never_arrives():
    slow, quick = [[0.0, 0.0, 0.0, 1.0]], [[0.0, 1.0, 0.0, 0.0]]
    assert saved(quick, slow, 1.0) == 0.5
    assert saved(slow, quick, 1.0) == -1
    assert np.isnan(saved([[0.0] * 4], slow, 1.0))
