from math import e, log, pi, sqrt

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch.distributions import Categorical as TorchCategorical
from torch.distributions import Independent, Normal, kl_divergence
from torch.testing import assert_close

from repaint_cli.policies.distributions import (
    Categorical,
    Gaussian,
    concat_policies,
    concat_samples,
    mixture,
)

seeds = st.integers(0, 2**32 - 1)


def gaussian(mean, std):
    return Gaussian(torch.tensor([[mean]]), torch.tensor([[std]]).log())


def categorical(*probs):
    return Categorical(torch.tensor([[probs]]).log())


def any_gaussian(seed):
    """S = 2, B = 3, A = 4, with its twin of torch."""
    torch.manual_seed(seed)
    mean, log_std = torch.randn(2, 3, 4), torch.randn(2, 1, 4) / 2
    return Gaussian(mean, log_std), Independent(Normal(mean, log_std.exp().expand(2, 3, 4)), 1)


def any_categorical(seed):
    """S = 2, B = 3, A = 5, with its twin of torch."""
    torch.manual_seed(seed)
    logits = torch.randn(2, 3, 5)
    return Categorical.from_logits(logits), TorchCategorical(logits=logits)


def weights_of(betas, n_seeds=2):
    return torch.tensor(betas, dtype=torch.float64)[:, None].expand(-1, n_seeds)


def test_log_prob_of_a_gaussian_by_hand():
    # two dimensions: N(3; 1, 2²) is one σ off, N(0; 0, 1) is at the mode
    density = 1 / sqrt(2 * pi * 4) * e**-0.5 / sqrt(2 * pi)
    found = gaussian([1.0, 0.0], [2.0, 1.0]).log_prob(torch.tensor([[[3.0, 0.0]]]))
    assert_close(found, torch.tensor([[log(density)]]))


def test_cross_entropy_of_gaussians_by_hand():
    # T = N(1, 2²), π = N(0, 1): ½·log 2π + (2² + 1²) / 2
    found = gaussian([1.0], [2.0]).cross_entropy(gaussian([0.0], [1.0]))
    assert_close(found, torch.tensor([[0.5 * log(2 * pi) + 2.5]]))


def test_cross_entropy_of_gaussians_is_the_integral():
    teacher, student = gaussian([0.5], [0.6]), gaussian([-0.3], [1.7])
    x = torch.linspace(-6, 7, 200_001, dtype=torch.float64).reshape(1, -1, 1)
    integrand = -teacher.log_prob(x).exp() * student.log_prob(x)
    integral = torch.trapezoid(integrand, x[..., 0])
    assert_close(teacher.cross_entropy(student), integral.reshape(1, 1).float())


def test_cross_entropy_pulls_the_mean_by_the_gap_in_variances():
    mean = torch.tensor([[[3.0]]], requires_grad=True)
    student = Gaussian(mean, torch.tensor([[[2.0]]]).log())
    gaussian([1.0], [0.1]).cross_entropy(student).sum().backward()
    assert_close(mean.grad, torch.tensor([[[(3.0 - 1.0) / 2.0**2]]]))


def test_cross_entropy_of_categoricals_by_hand():
    # in bits: ½·2 + ¼·2 + ¼·1
    found = categorical(0.5, 0.25, 0.25).cross_entropy(categorical(0.25, 0.25, 0.5))
    assert_close(found, torch.tensor([[1.75 * log(2)]]))


def test_entropies_by_hand():
    assert_close(gaussian([7.0, 7.0], [1.0, 2.0]).entropy(), torch.tensor([[log(4 * pi * e)]]))
    assert_close(categorical(0.5, 0.25, 0.25).entropy(), torch.tensor([[1.5 * log(2)]]))


@given(seeds)
def test_gaussian_agrees_with_torch(seed):
    (ours, theirs), (other, other_twin) = any_gaussian(seed), any_gaussian(seed + 1)
    actions = torch.randn(2, 3, 4)
    assert_close(ours.log_prob(actions), theirs.log_prob(actions))
    assert_close(ours.entropy().expand(2, 3), theirs.entropy())
    expected = theirs.entropy() + kl_divergence(theirs, other_twin)
    assert_close(ours.cross_entropy(other), expected, rtol=1e-5, atol=1e-5)


@given(seeds)
def test_categorical_agrees_with_torch(seed):
    (ours, theirs), (other, other_twin) = any_categorical(seed), any_categorical(seed + 1)
    actions = torch.randint(5, (2, 3))
    assert_close(ours.log_prob(actions), theirs.log_prob(actions))
    assert_close(ours.entropy(), theirs.entropy())
    expected = theirs.entropy() + kl_divergence(theirs, other_twin)
    assert_close(ours.cross_entropy(other), expected)


@given(seeds, st.sampled_from([any_gaussian, any_categorical]))
def test_no_student_is_closer_to_the_teacher_than_the_teacher(seed, family):
    teacher, student = family(seed)[0], family(seed + 1)[0]
    own = teacher.cross_entropy(teacher)
    assert_close(own, teacher.entropy().expand_as(own))
    assert (teacher.cross_entropy(student) >= own - 1e-5).all()


def test_a_gaussian_sample_is_the_mean_plus_sigma_times_noise():
    found = gaussian([1.0, 2.0], [0.5, 3.0]).sample(torch.tensor([[[2.0, -1.0]]]))
    assert_close(found, torch.tensor([[[2.0, -1.0]]]))


def test_categorical_samples_come_as_often_as_they_should():
    probs = torch.tensor([0.6, 0.3, 0.1])
    noise = Categorical.noise(np.random.default_rng(0), (1, 40_000, 3))
    actions = Categorical(probs.log().expand(1, 40_000, 3)).sample(torch.from_numpy(noise))
    frequencies = actions.flatten().bincount() / 40_000
    assert_close(frequencies, probs, atol=0.01, rtol=0)  # four standard errors


@pytest.mark.parametrize("family", [Gaussian, Categorical])
def test_noise_belongs_to_its_generator(family):
    first, again, other = (family.noise(np.random.default_rng(s), (2, 3)) for s in (1, 1, 2))
    assert first.dtype == np.float32
    np.testing.assert_array_equal(first, again)
    assert (first != other).all()


def test_the_mode_is_the_most_likely_action():
    assert_close(gaussian([1.0, -2.0], [9.0, 9.0]).mode(), torch.tensor([[[1.0, -2.0]]]))
    assert categorical(0.2, 0.5, 0.3).mode().item() == 1


def test_softening_a_gaussian_raises_only_what_is_below_the_floor():
    soft = gaussian([1.0, 2.0], [0.01, 0.9]).soften(min_std=0.4, temperature=7.0)
    assert_close(soft.log_std.exp(), torch.tensor([[[0.4, 0.9]]]))
    assert_close(soft.mean, torch.tensor([[[1.0, 2.0]]]))


def test_softening_a_categorical_divides_the_log_odds():
    soft = categorical(0.8, 0.2).soften(min_std=7.0, temperature=2.0)  # odds 4 become √4
    assert_close(soft.log_probs.exp(), torch.tensor([[[2 / 3, 1 / 3]]]))


@pytest.mark.parametrize("family", [any_gaussian, any_categorical])
def test_softening_by_nothing_changes_no_bit(family):
    distribution = family(0)[0]
    assert distribution.soften(min_std=0.0, temperature=1.0) is distribution


@pytest.mark.parametrize("family", [any_gaussian, any_categorical])
def test_rows_are_picked_seed_by_seed(family):
    distribution = family(0)[0]
    rows = torch.arange(2).unsqueeze(1), torch.tensor([[2, 0], [1, 1]])
    whole = distribution.cross_entropy(distribution)
    picked = distribution[rows].cross_entropy(distribution[rows])
    assert_close(picked, whole[rows])


@pytest.mark.parametrize("family", [any_gaussian, any_categorical])
@given(seed=seeds, betas=st.lists(st.floats(0.01, 2), min_size=2, max_size=3))
def test_a_blend_has_the_weighted_cross_entropies_of_its_parts(family, seed, betas):
    teachers = [family(seed + i)[0] for i in range(len(betas))]
    student = family(seed + 7)[0]
    whole = mixture(teachers, weights_of(betas)).cross_entropy(student)
    parts = sum(b * t.cross_entropy(student) for b, t in zip(betas, teachers, strict=True))
    assert_close(sum(betas) * whole, parts, rtol=1e-4, atol=1e-4)


def test_a_blend_of_two_gaussians_by_hand():
    # means ±1 with equal weights and σ = 1: variance 1 + 1
    found = mixture([gaussian([1.0], [1.0]), gaussian([-1.0], [1.0])], weights_of([0.3, 0.3], 1))
    assert_close(found.mean, torch.zeros(1, 1, 1))
    assert_close(found.log_std.exp(), torch.full((1, 1, 1), sqrt(2)))


@pytest.mark.parametrize("make", [any_gaussian, any_categorical])
def test_a_blend_of_one_is_itself(make):
    teacher = make(0)[0]
    assert mixture([teacher], weights_of([0.2])) is teacher


@pytest.mark.parametrize("make", [any_gaussian, any_categorical])
def test_policies_side_by_side_keep_their_own_samples_and_spreads(make):
    first, second = make(0)[0], make(1)[0]
    whole, noise = concat_policies([first, second]), torch.rand(2, 6, first.n_actions)
    parts = [first.sample(noise[:, :3]), second.sample(noise[:, 3:])]
    assert_close(whole.sample(noise), torch.cat(parts, 1))
    rows = (torch.arange(2)[:, None], torch.tensor([[5, 0], [3, 2]]))
    assert_close(
        whole[rows].sample(noise[:, :2])[0, 0],
        second[rows[0], rows[1] - 3].sample(noise[:, :2])[0, 0],
    )


def test_one_policy_joined_keeps_one_spread():
    first = any_gaussian(0)[0]
    assert concat_samples([first, first]).log_std.shape == (2, 1, 4)


@pytest.mark.parametrize("make", [any_gaussian, any_categorical])
def test_weights_of_a_blend_may_be_each_seeds_own_and_all_zero(make):
    first, second = make(0)[0], make(1)[0]
    found = mixture([first, second], torch.tensor([[1.0, 0.0], [0.0, 0.0]]))
    mode = found.mode()[0] == first.mode()[0]
    assert mode.all()
    assert all(torch.isfinite(part).all() for part in vars(found).values())
