import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch.testing import assert_close

from repaint_cli.learn.advantages import Samples
from repaint_cli.learn.frames import Frames
from repaint_cli.learn.selection import above_threshold, moments, rescale, standardize

NAN = float("nan")
numbers = st.floats(-100, 100, width=32)


def batch(*advantages):
    """Samples with these advantages, one list per seed; the rest is padding."""
    counts = torch.tensor([len(row) for row in advantages])
    padded = torch.full((len(advantages), int(counts.max())), 1e6)
    for s, row in enumerate(advantages):
        padded[s, : len(row)] = torch.tensor(row)
    zeros = torch.zeros_like(padded)
    frames = Frames([torch.zeros(1, 1) for _ in advantages])
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
