import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch.testing import assert_close

from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.learn.rollout.observations import Observations
from repaint_cli.learn.transfer.selection import (
    Selection,
    above_threshold,
    drawn,
    moments,
    on_loss_scale,
    prioritized,
    rescale,
    select,
    standardize,
)
from repaint_cli.tasks.transfer_settings import SelectConfig

NAN = float("nan")
numbers = st.floats(-100, 100, width=32)


def batch(*advantages):
    """Samples with these advantages, one list per seed; the rest is padding."""
    counts = torch.tensor([len(row) for row in advantages])
    padded = torch.full((len(advantages), int(counts.max())), 1e6)
    for s, row in enumerate(advantages):
        padded[s, : len(row)] = torch.tensor(row)
    zeros = torch.zeros_like(padded)
    frames = Observations([torch.zeros(1, 1) for _ in advantages])
    return Samples(frames, zeros.long(), zeros, zeros, padded, zeros, zeros, counts)


def test_moments_are_each_seeds_own_and_padding_is_not_counted():
    mean, std = moments(batch([1.0, 3.0], [0.0, 0.0, 3.0, 5.0]))
    assert_close(mean, torch.tensor([[2.0], [2.0]]))
    assert_close(std, torch.tensor([[1.0], [4.5**0.5]]))


@given(st.lists(numbers, min_size=1, max_size=20))
def test_moments_are_numpys(advantages):
    mean, std = moments(batch(advantages))
    assert_close(mean.item(), float(np.mean(advantages)), rtol=1e-5, atol=1e-4)
    assert_close(std.item(), float(np.std(advantages)), rtol=1e-5, atol=1e-4)


def test_standardize_by_hand():
    samples = batch([1.0, 3.0, 5.0])
    by = (torch.tensor([[2.0]]), torch.tensor([[0.5]]))
    assert_close(standardize(samples, by).advantages, torch.tensor([[-2.0, 2.0, 6.0]]))
    assert_close(samples.advantages, torch.tensor([[1.0, 3.0, 5.0]]))


def test_equal_advantages_standardise_to_zero_and_not_to_nan():
    samples = batch([4.0, 4.0, 4.0])
    assert_close(standardize(samples, moments(samples)).advantages, torch.zeros(1, 3))


@pytest.mark.parametrize(
    ("scale", "expected"),
    [("selected", [-1.0, 1.0]), ("raw", [7.0, -8.0]), ("student", [3.5, -4.0])],
)
def test_what_is_learned_has_a_scale_of_its_own(scale, expected):
    raw, student = batch([7.0, -8.0]), (torch.tensor([[1.0]]), torch.tensor([[2.0]]))
    learned = on_loss_scale(raw, batch([-1.0, 1.0]), scale, student)
    assert_close(learned.advantages, torch.tensor([expected]))
    nothing = (torch.zeros(1, 1), torch.zeros(1, 1))
    assert torch.isfinite(on_loss_scale(raw, raw, scale, nothing).advantages).all()


def test_fewer_samples_than_the_least_are_left_out():
    chosen = Selection(torch.zeros(3, 5).long(), torch.tensor([3, 4, 5]))
    assert chosen.at_least(4).counts.tolist() == [0, 4, 5]
    assert chosen.at_least(0).counts.tolist() == [3, 4, 5]


@pytest.mark.parametrize(
    ("scale", "expected"),
    [
        ("teacher-batch", [-1.0, 1.0]),
        ("student-batch", [3.0, 3.5]),  # (7 − 1) / 2, (8 − 1) / 2: both far above the student's own
        ("none", [7.0, 8.0]),
    ],
)
def test_the_scale_of_zeta_is_the_teachers_batch_the_students_or_raw(scale, expected):
    student = (torch.tensor([[1.0]]), torch.tensor([[2.0]]))
    found = rescale(batch([7.0, 8.0]), scale, student)
    assert_close(found.advantages, torch.tensor([expected]))


def test_an_advantage_of_exactly_zeta_is_kept():
    kept = above_threshold(torch.tensor([[0.79, 0.8, 0.81, -2.0]]), 0.8)
    assert kept.tolist() == [[False, True, True, False]]


@given(st.lists(numbers, min_size=1, max_size=20), numbers, numbers)
def test_a_higher_threshold_keeps_a_subset(advantages, one, other):
    low, high = sorted((one, other))
    kept = {zeta: above_threshold(torch.tensor([advantages]), zeta) for zeta in (low, high)}
    assert (kept[low] | ~kept[high]).all()


def kept(rule, *advantages, threshold=0.5, **settings):
    """The advantages a rule keeps, one list per seed."""
    samples, config = batch(*advantages), SelectConfig(rule=rule, **settings)
    rngs = [np.random.default_rng(s) for s in range(len(advantages))]
    chosen = select(samples, config, threshold, rngs)
    found = chosen.of(samples)
    return [row[:n].tolist() for row, n in zip(found.advantages, found.counts, strict=True)]


@pytest.mark.parametrize(
    ("rule", "expected"),
    [
        ("zeta", [[0.5, 2.0], []]),
        ("abs", [[-3.0, 0.5, 2.0], [-1.0]]),
        ("top", [[2.0, 0.5], [0.0]]),
        ("all", [[-3.0, 0.5, 2.0, 0.25], [-1.0, 0.0]]),
    ],
)
def test_rules_by_hand(rule, expected):
    found = kept(rule, [-3.0, 0.5, 2.0, 0.25], [-1.0, 0.0], share=0.5)
    assert [sorted(row) for row in found] == [sorted(row) for row in expected]


@given(st.lists(numbers, min_size=1, max_size=40), st.floats(0.01, 1))
def test_top_keeps_its_share_and_nothing_left_out_is_higher(advantages, share):
    (found,) = kept("top", advantages, [0.0], share=share)[:1]
    assert len(found) == max(1, int(np.ceil(share * len(advantages) - 1e-9)))
    rest = sorted(np.float32(advantages))[: len(advantages) - len(found)]
    assert not rest or max(rest) <= min(found)


def test_a_fifth_of_five_is_one():
    assert kept("top", [1.0, 2.0, 3.0, 4.0, 5.0], share=0.2) == [[5.0]]


def test_priorities_draw_by_size_and_weights_make_up_for_it():
    # p = 1, 3: chances ¼, ¾; with β = 1 weights (1 / ½, 1 / 1.5) over their largest: 1, ⅓
    config = SelectConfig(rule="per", share=1.0, priority_exponent=1.0, importance_exponent=1.0)
    samples, picks, rng = batch([1.0, -3.0]), [], np.random.default_rng(0)
    for _ in range(2000):
        chosen = prioritized(samples, config, [rng])
        picks += chosen.positions[0].tolist()
        for position, weight in zip(chosen.positions[0], chosen.weights[0], strict=True):
            assert weight == pytest.approx([1.0, 1 / 3][position], rel=1e-5)
    assert np.mean(picks) == pytest.approx(0.75, abs=0.03)


def test_a_weight_scales_the_instance_loss_of_its_sample():
    config = SelectConfig(rule="per", share=1.0, priority_exponent=1.0, importance_exponent=1.0)
    samples = batch([1.0, -3.0])
    chosen = prioritized(samples, config, [np.random.default_rng(0)])
    assert_close(chosen.of(samples).advantages[0].abs(), torch.ones(2))  # 1·1 and ⅓·3


def test_alpha_0_draws_all_alike_and_beta_0_weighs_all_alike():
    config = SelectConfig(rule="per", share=1.0, priority_exponent=0.0, importance_exponent=0.0)
    samples = batch([100.0, *[0.001] * 9])
    chosen = prioritized(samples, config, [np.random.default_rng(0)])
    assert sorted(chosen.positions[0].tolist()) == list(range(10))  # a stratum each
    assert_close(chosen.weights, torch.ones(1, 10))


def test_padding_is_never_drawn():
    config = SelectConfig(rule="per", share=1.0)
    chosen = prioritized(
        batch([1.0] * 9, [2.0]), config, [np.random.default_rng(s) for s in (0, 1)]
    )
    assert chosen.counts.tolist() == [9, 1]
    assert chosen.positions[1, 0] == 0


@given(st.lists(st.floats(0, 1), min_size=1, max_size=20), st.integers(1, 50), st.integers(0, 9))
def test_what_has_no_chance_is_not_drawn_and_each_gets_its_due(chances, n, seed):
    heap = np.array([*chances, 1.0])
    (row,), _ = drawn(
        torch.from_numpy(heap)[None], torch.tensor([n]), [np.random.default_rng(seed)]
    )
    times = np.bincount(row, minlength=len(heap))
    due = n * heap / heap.sum()
    assert not times[heap == 0].any()
    assert (np.abs(times - due) < 2).all()  # strata
