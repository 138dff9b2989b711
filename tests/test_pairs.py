"""Differences of two runs, their tests, and how often the intervals hold the truth."""

from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats

from repaint_cli.report.pairs import (
    better,
    difference,
    permutation_p,
    seeds_needed,
    sign_flip_p,
    welch,
)

NAN = np.nan


def test_shared_seeds_are_compared_pair_by_pair_in_whatever_order():
    own, others = [3.0, 1.0, 2.0], [10.0, 1.0, 0.0, 2.5]
    found = difference(own, others, [7, 5, 6], [9, 7, 5, 6])
    gaps = np.array([3.0 - 1.0, 1.0 - 0.0, 2.0 - 2.5])
    wide = stats.t.ppf(0.975, 2) * gaps.std(ddof=1) / np.sqrt(3)
    assert found.pairs == 3
    assert_allclose(found.mean, [gaps.mean(), gaps.mean() - wide, gaps.mean() + wide])
    assert found.p == sign_flip_p(gaps)
    assert found.smallest_p == 2 / 8


def test_runs_that_share_no_two_seeds_are_compared_by_welch():
    own, others = [1.0, 2.0, 4.0], [0.0, 0.5, 3.0, 1.0]
    found = difference(own, others, [0, 1, 2], [2, 3, 4, 5])
    assert found.pairs == 0
    assert found.mean == welch(own, others)
    assert found.smallest_p == 2 / 35  # 7 over 3
    test = stats.ttest_ind(own, others, equal_var=False).confidence_interval()
    assert_allclose(found.mean[1:], [test.low, test.high])


def test_one_seed_a_side_shows_a_gap_and_no_spread():
    found = difference([3.0], [1.0], [0], [0])
    assert_array_equal(found.mean, [2, NAN, NAN])
    assert np.isnan([found.p, found.smallest_p, found.seeds_needed]).all()


def test_a_number_that_is_missing_leaves_no_difference():
    found = difference([3.0, NAN], [1.0, 2.0], [0, 1], [0, 1])
    assert np.isnan([*found.mean, found.p]).all()


def test_runs_that_are_the_same_differ_by_nothing():
    found = difference([1.0, 2.0], [1.0, 2.0], [0, 1], [0, 1])
    assert found.mean == (0, 0, 0)
    assert found.p == 1
    assert np.isnan(found.seeds_needed)


def test_p_of_paired_differences_by_all_signs():
    gaps = np.array([1.0, 2.0, -0.5, 4.0])
    means = [(np.array(signs) * gaps).mean() for signs in product([1, -1], repeat=4)]
    above = np.mean([mean >= gaps.mean() - 1e-12 for mean in means])
    assert sign_flip_p(gaps) == pytest.approx(2 * above)
    assert sign_flip_p([1.0, 2.0, 3.0]) == pytest.approx(2 / 8)  # as small as it can be
    assert np.isnan(sign_flip_p([1.0]))


def test_p_of_many_pairs_is_drawn_and_never_zero():
    gaps = np.arange(1.0, 21.0)
    assert sign_flip_p(gaps) == pytest.approx(2 / 10_001)
    seeds = range(20)
    assert difference(gaps, np.zeros(20), seeds, seeds).smallest_p == pytest.approx(2 / 10_001)


def test_p_of_two_groups_by_hand():
    # of 20 ways to choose three of six, one is as high as this one and one as low
    assert permutation_p([4.0, 5.0, 6.0], [1.0, 2.0, 3.0]) == pytest.approx(2 / 20)
    assert permutation_p([1.0, 2.0, 3.0], [1.0, 2.0, 3.0]) == pytest.approx(1)
    assert np.isnan(permutation_p([1.0], [2.0, 3.0]))


def test_the_chance_to_be_better_is_that_of_mann_and_whitney():
    rng = np.random.default_rng(2)
    own, others = rng.normal(0.5, 1, 7), rng.normal(0, 1, 9)
    p, low, high = better(own, others)
    assert p == pytest.approx(stats.mannwhitneyu(own, others).statistic / 63)
    assert 0 < low < p < high < 1
    mirrored = better(others, own)
    assert_allclose(mirrored, [1 - p, 1 - high, 1 - low], atol=1e-9)
    assert better([1.0, 2.0], [1.0, 3.0])[0] == 0.375  # one is alike, which counts half


def test_seeds_that_are_all_above_leave_some_doubt():
    p, low, high = better([4.0, 5.0, 6.0], [1.0, 2.0, 3.0])
    assert (p, high) == (1, 1)
    assert 0.3 < low < 0.7
    assert better([4.0, 5.0, 6.0, 7.0, 8.0], [1.0, 2.0, 3.0, 0.0, -1.0])[1] > low
    assert_array_equal(better([4.0], [1.0]), [1, NAN, NAN])
    assert np.isnan(better([NAN, 1.0], [1.0, 2.0])).all()


@pytest.mark.parametrize("effect", [0.3, 0.5, 1.0])
def test_so_many_seeds_have_the_power_that_was_asked_for(effect):
    n = seeds_needed(effect)
    far = effect * np.sqrt(n)
    power = stats.nct.sf(stats.t.ppf(0.975, n - 1), n - 1, far)
    assert 0.78 < power < 0.85
    each = seeds_needed(effect, paired=False)
    far = effect * np.sqrt(each / 2)
    power = stats.nct.sf(stats.t.ppf(0.975, 2 * each - 2), 2 * each - 2, far)
    assert 0.78 < power < 0.85


def test_seeds_needed_ends_somewhere():
    assert seeds_needed(50.0) == 6  # with five p cannot be below 0.06
    assert seeds_needed(50.0, paired=False) == 4
    assert seeds_needed(1e-3) == np.inf
    assert np.isnan(seeds_needed(0.0))
