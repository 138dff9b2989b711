from math import log

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch.testing import assert_close

from repaint_cli.learn.update.losses import (
    approx_kl,
    clipped_surrogate,
    log_likelihood,
    squared_error,
    surrogate,
)


@pytest.mark.parametrize(
    ("ratio", "advantage", "loss", "slope"),
    [
        (1.1, 3.0, -3.3, -3.3),  # within the clip the slope in log π is −ρA
        (0.9, -3.0, 2.7, 2.7),
        (1.5, 3.0, -3.6, 0.0),  # a good action, likely enough: −1.2·A, and no further
        (0.5, 3.0, -1.5, -1.5),  # a good action, too unlikely: come back
        (1.5, -3.0, 4.5, 4.5),  # a bad action, too likely: go back
        (0.5, -3.0, 2.4, 0.0),  # a bad action, unlikely enough: −0.8·A, and no further
    ],
)
def test_clipped_surrogate_by_hand(ratio, advantage, loss, slope):
    behavior = torch.tensor([[-2.0]])
    log_probs = torch.tensor([[-2.0 + log(ratio)]], requires_grad=True)
    found = clipped_surrogate(log_probs, behavior, torch.tensor([[advantage]]), clip_range=0.2)
    found.sum().backward()
    assert_close(found.detach(), torch.tensor([[loss]]))
    assert_close(log_probs.grad, torch.tensor([[slope]]))


def test_a_teachers_action_the_student_never_takes_has_next_to_no_slope():
    log_probs = torch.tensor([[-20.0]], requires_grad=True)
    clipped_surrogate(log_probs, torch.tensor([[0.0]]), torch.tensor([[1.0]]), 0.2).sum().backward()
    assert 0 < -log_probs.grad.item() < 1e-8


def test_squared_error_by_hand():
    values, returns = torch.tensor([[1.0, -2.0]]), torch.tensor([[4.0, -2.0]])
    assert_close(squared_error(values, returns), torch.tensor([[9.0, 0.0]]))


def test_approx_kl_by_hand():
    # ρ = 2: 2 − 1 − log 2
    found = approx_kl(torch.tensor([[log(2.0)]]), torch.tensor([[0.0]]))
    assert_close(found, torch.tensor([[1 - log(2)]]))


def test_approx_kl_is_the_divergence_in_the_mean():
    mu, pi = torch.tensor([0.5, 0.3, 0.2]), torch.tensor([0.2, 0.2, 0.6])
    assert_close((mu * approx_kl(pi.log(), mu.log())).sum(), (mu * (mu / pi).log()).sum())


@given(st.floats(-20, 20))
def test_approx_kl_is_never_negative(log_ratio):
    found = approx_kl(torch.tensor([[log_ratio]], dtype=torch.float64), torch.zeros(1, 1))
    assert found.item() >= -1e-15


def test_log_likelihood_by_hand():
    log_probs = torch.tensor([[-2.0, -0.5]], requires_grad=True)
    found = log_likelihood(log_probs, torch.tensor([[3.0, -4.0]]))
    found.sum().backward()
    assert_close(found.detach(), torch.tensor([[6.0, -2.0]]))
    assert_close(log_probs.grad, torch.tensor([[-3.0, 4.0]]))


def test_surrogate_by_hand():
    behavior = torch.tensor([[-2.0]])
    log_probs = torch.tensor([[-2.0 + log(1.5)]], requires_grad=True)
    found = surrogate(log_probs, behavior, torch.tensor([[3.0]]))
    found.sum().backward()
    assert_close(found.detach(), torch.tensor([[-4.5]]))
    assert_close(log_probs.grad, torch.tensor([[-4.5]]))  # unclipped, unlike PPO's


def test_where_nothing_has_moved_all_objectives_have_one_slope():
    advantages, behavior = torch.tensor([[3.0, -1.0]]), torch.tensor([[-2.0, -0.3]])
    slopes = []
    for loss in (
        lambda log_probs: clipped_surrogate(log_probs, behavior, advantages, 0.2),
        lambda log_probs: log_likelihood(log_probs, advantages),
        lambda log_probs: surrogate(log_probs, behavior, advantages),
    ):
        log_probs = behavior.clone().requires_grad_()
        loss(log_probs).sum().backward()
        slopes.append(log_probs.grad)
    assert_close(slopes[0], slopes[1])
    assert_close(slopes[0], slopes[2])
