import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from repaint_cli.report.statistics import (
    area_by_steps,
    area_under_curve,
    bootstrap_mean,
    converged_score,
    far_off,
    interquartile_mean,
    interquartile_mean_of,
    iteration_of_mean,
    iterations_to,
    mean_ci,
    mean_of,
    t_interval,
    trims,
)

NAN = np.nan


def test_the_interval_of_two_runs_is_the_two_runs():
    # drawing two of {0, 1} gives a mean of 0, ½, 1 with chances ¼, ½, ¼
    assert mean_ci([0.0, 1.0]) == (0.5, 0.0, 1.0)
    assert mean_ci([0.0, 1.0], level=0.4) == (0.5, 0.5, 0.5)


def test_the_interval_of_many_runs_is_that_of_the_normal_law():
    values = np.random.default_rng(3).normal(7.0, 2.0, 400)
    mean, low, high = mean_ci(values)
    wide = 1.96 * values.std() / 20
    assert mean == pytest.approx(values.mean())
    assert_allclose([low, high], [mean - wide, mean + wide], atol=0.02)


def test_a_higher_level_is_a_wider_interval():
    values = [1.0, 2.0, 4.0, 8.0, 9.0]
    _, low, high = mean_ci(values, level=0.8)
    _, lower, higher = mean_ci(values, level=0.99)
    assert lower < low < high < higher


def test_the_same_seed_gives_the_same_interval_and_order_does_not_matter_to_the_mean():
    values = [3.0, 1.0, 4.0, 1.5, 9.0]
    assert mean_ci(values, seed=1) == mean_ci(values, seed=1)
    assert mean_ci(values)[0] == mean_ci(values[::-1])[0]


@pytest.mark.parametrize("values", [[], [NAN, 1.0, 2.0]], ids=["no runs", "a run without a value"])
def test_no_mean_without_every_value(values):
    assert_array_equal(mean_ci(values), [NAN] * 3)


def test_one_run_has_a_mean_and_no_interval():
    assert_array_equal(mean_ci([4.0]), [4.0, NAN, NAN])


def test_a_gap_in_one_column_leaves_the_others_their_interval():
    low, high = bootstrap_mean(np.array([[0.0, 1.0, NAN], [0.0, 2.0, 5.0]]))
    assert_array_equal(low, [0.0, 1.0, NAN])
    assert_array_equal(high, [0.0, 2.0, NAN])


def test_area_under_a_curve_is_its_mean_height():
    assert_allclose(
        area_under_curve([[2.0, 2.0, 2.0], [0.0, 2.0, 4.0], [0.0, 4.0, 0.0]]), [2, 2, 2]
    )


def test_area_bridges_iterations_nobody_was_evaluated_at():
    assert_allclose(area_under_curve([[NAN, 0.0, NAN, NAN, 6.0, NAN]]), [3.0])


def test_a_seed_that_stopped_early_has_no_area():
    assert_array_equal(area_under_curve([[1.0, 1.0, 1.0], [9.0, 9.0, NAN]]), [1.0, NAN])


def test_area_of_one_iteration_or_none():
    assert_array_equal(area_under_curve([[3.0], [4.0]]), [3.0, 4.0])
    assert_array_equal(area_under_curve(np.full((2, 3), NAN)), [NAN, NAN])
    assert_array_equal(area_under_curve(np.empty((2, 0))), [NAN, NAN])


def test_iterations_count_from_one_and_never_is_nan():
    returns = [[5.0, 0.0, 0.0], [0.0, 4.0, 1.0], [0.0, NAN, 4.5], [0.0, 3.9, NAN]]
    assert_array_equal(iterations_to(returns, 4.0), [1, 2, 3, NAN])
    assert_array_equal(iterations_to(np.empty((2, 0)), 4.0), [NAN, NAN])


def test_a_flat_list_is_refused():
    with pytest.raises(ValueError, match="seeds, iterations"):
        iterations_to([1.0, 2.0], 1.0)


def test_a_t_interval_by_the_table():
    # s of 1, 2, 3 is 1; t of two degrees of freedom is 4.303
    mean, low, high = t_interval([[1.0, 5.0], [2.0, 5.0], [3.0, NAN]])
    assert_allclose([mean[0], low[0], high[0]], [2, 2 - 4.3027 / 3**0.5, 2 + 4.3027 / 3**0.5], 1e-4)
    assert np.isnan([mean[1], low[1], high[1]]).all()
    assert_array_equal(mean_of([4.0]), [4, NAN, NAN])
    assert np.isnan(mean_of([])).all()


def test_the_interquartile_mean_leaves_out_a_quarter_at_each_end():
    assert interquartile_mean([100.0, 1.0, 2.0, -50.0]) == 1.5
    assert interquartile_mean([3.0]) == 3.0
    mean, low, high = interquartile_mean_of([1.0, 2.0, 3.0, 4.0, 50.0])
    assert mean == 3
    # winsorised 2 2 3 4 4: s 1; three are left, t of two degrees of freedom is 4.303
    assert (high - mean, mean - low) == pytest.approx((4.303 * 5**0.5 / 3,) * 2, rel=1e-3)
    assert_array_equal(interquartile_mean_of([3.0]), [3, NAN, NAN])


def test_with_three_seeds_nothing_can_be_left_out():
    assert [trims(n) for n in (1, 3, 4, 7, 8)] == [0, 0, 1, 1, 2]
    values = [1.0, 2.0, 30.0]
    assert_allclose(interquartile_mean_of(values), mean_of(values))


def test_the_mean_reaches_the_target_or_does_not():
    assert iteration_of_mean([[0.0, 2.0, 4.0], [0.0, 0.0, 4.0]], 1.0) == 2
    assert np.isnan(iteration_of_mean([[0.0, 1.0]], 2.0))


def test_the_area_over_steps_is_that_of_straight_lines():
    returns, steps = [[0.0, 2.0, 2.0], [0.0, 4.0, 8.0]], [[100, 200, 400], [50, 150, 350]]
    # from 100 to 350: 0 to 2 over 100, then 2 for 150; 2 to 4 over 50, then 4 to 8 over 200
    expected = [(100 * 1 + 150 * 2) / 250, (50 * 3 + 200 * 6) / 250]
    assert_allclose(area_by_steps(returns, steps, 100, 350), expected)
    assert np.isnan(area_by_steps(returns, steps, 400, 400)).all()
    assert np.isnan(area_by_steps([[1.0, 2.0]], [[NAN, 5.0]], 1, 4)).all()


def test_a_run_converged_to_the_last_fifth_of_its_mean():
    assert converged_score([[0.0] * 8 + [1.0, 2.0], [0.0] * 8 + [3.0, 4.0]]) == 2.5
    assert converged_score([[0.0, 7.0]]) == 7


def test_numbers_that_lie_far_from_the_others():
    assert far_off([1, 2, 3, 4, -40]).tolist() == [False] * 4 + [True]
    assert not far_off([1, 2, 3, 4, 12]).any()  # six of their standard deviations
    assert not far_off([1, 2, 3, -40]).any()  # too few to tell
    assert not far_off([1, 1, 1, 1, 5]).any()  # nothing to compare with
    assert not far_off([1, 2, 3, 4, np.nan]).any()
    many = np.random.default_rng(0).normal(size=(10_000, 5))
    assert np.mean([far_off(one).any() for one in many]) < 0.05
