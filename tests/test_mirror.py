"""A policy's mirror image: the same network, with other weights, in the other world."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch.testing import assert_close

from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.distributions import Categorical, Gaussian
from repaint_cli.policies.mirror import BothViews, mirrored
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.spaces import Spaces
from repaint_cli.symmetry import SignedPermutation, Symmetry

SEEDS, BATCH = 2, 7
VECTOR = Symmetry(
    "mirrored", SignedPermutation((1, 0, 2), (-1, -1, 1)),
    SignedPermutation((0, 3, 2, 1), (-1, 1, 1, 1)), None, None, frozenset(),
)  # fmt: skip
NUMBERED = replace(VECTOR, actions=SignedPermutation((2, 1, 0), (1, 1, 1)))
CAR = Symmetry(
    "mirrored", SignedPermutation((2, 1, 0), (1, 1, 1)), None, (1, 0), (4, 3, 2, 1, 0), frozenset()
)
CONV = ((4, 4, 2), (3, 3, 2))
CASES = {
    "continuous": (Spaces((4,), 3, False), NetConfig(hidden=(5, 6)), VECTOR),
    "numbered": (Spaces((4,), 3, True), NetConfig(hidden=(5,), value_hidden=()), NUMBERED),
    "linear": (Spaces((4,), 3, False), NetConfig(hidden=()), VECTOR),
    "as they are": (Spaces((4,), 3, False), NetConfig(obs_normalize=False), VECTOR),
    # 31 columns, of which pooling and strides leave some out
    "car": (Spaces((20, 31, 2), 3, True, 5), NetConfig(kind="cnn", conv=CONV, dense=8), CAR),
    "eyes": (
        Spaces((20, 31, 2), 3, True), NetConfig(kind="cnn", conv=CONV, pool=1, shared=True),
        replace(CAR, beams=None),
    ),
}  # fmt: skip


def network_of(spaces, net, seed=0):
    """Two policies with weights and statistics of observations, all different."""
    network = ActorCritic(spaces, net, SEEDS)
    rng = np.random.default_rng(seed)
    for weight in network.weights.values():
        weight.data.copy_(torch.from_numpy(rng.normal(0, 0.4, weight.shape)))
    if network.normalizer:
        for s in range(SEEDS):
            seen = rng.normal(s, [1, 2, 3, 4], (50, 4))
            network.normalizer.update(s, torch.from_numpy(seen))
    return network


def observations(spaces):
    """Observations of both seeds, as networks read them."""
    draw = torch.Generator().manual_seed(1)
    if not spaces.image:
        return torch.randn(SEEDS, BATCH, *spaces.obs_shape, generator=draw)
    shape = (SEEDS, BATCH, *spaces.obs_shape)
    images = torch.randint(256, shape, generator=draw, dtype=torch.uint8)
    if not spaces.n_beams:
        return images
    return {"camera": images, "lidar": torch.rand(SEEDS, BATCH, spaces.n_beams, generator=draw)}


def in_mirror(policy, symmetry):
    """The distribution of g·a, by hand."""
    order = list(symmetry.actions.order)
    if isinstance(policy, Categorical):
        return Categorical(policy.log_probs[..., order])
    signs = torch.tensor(symmetry.actions.signs)
    return Gaussian(policy.mean[..., order] * signs, policy.log_std[..., order])


def assert_same(one, other):
    for name in ("log_probs",) if isinstance(one, Categorical) else ("mean", "log_std"):
        assert_close(getattr(one, name), getattr(other, name), rtol=1e-5, atol=1e-5)


def different(network, other, obs):
    """How far two policies are apart."""
    actions = network.policy(obs).mode()
    return float(
        (network.policy(obs).log_prob(actions) - other.policy(obs).log_prob(actions)).std()
    )


@pytest.mark.parametrize("case", CASES)
@torch.no_grad()
def test_an_image_does_in_the_mirror_what_its_network_does(case):
    spaces, net, symmetry = CASES[case]
    network, obs = network_of(spaces, net), observations(spaces)
    image, seen = mirrored(network, symmetry), symmetry.observe(obs)
    assert_same(image.policy(obs), in_mirror(network.policy(seen), symmetry))
    assert_close(image.value(obs), network.value(seen), rtol=1e-5, atol=1e-5)
    assert different(network, image, obs) > 0.05  # else nothing is shown


@pytest.mark.parametrize("case", CASES)
def test_the_image_of_an_image_is_the_network_itself(case):
    spaces, net, symmetry = CASES[case]
    network = network_of(spaces, net)
    again = mirrored(mirrored(network, symmetry), symmetry)
    assert torch.equal(again.storage, network.storage)
    assert again.net == network.net
    if network.normalizer and again.normalizer:
        assert torch.equal(again.normalizer.mean, network.normalizer.mean)
        assert torch.equal(again.normalizer.count, network.normalizer.count)


@pytest.mark.parametrize("case", CASES)
def test_an_image_has_memory_of_its_own(case):
    spaces, net, symmetry = CASES[case]
    network = network_of(spaces, net)
    before = network.storage.clone()
    mirrored(network, symmetry).storage.fill_(0.0)
    assert torch.equal(network.storage, before)


@pytest.mark.parametrize(
    ("case", "wrong"),
    [
        ("continuous", {"vector": SignedPermutation((0, 3, 2, 1), (1, 1, 1, 1))}),
        ("continuous", {"actions": SignedPermutation((1, 0, 2), (1, 1, 1))}),
        ("car", {"channels": (0, 1)}),  # eyes that do not change places
        ("car", {"beams": (0, 1, 2, 3, 4)}),
        ("car", {"actions": SignedPermutation.identity(3)}),
    ],
)
@torch.no_grad()
def test_each_part_of_a_symmetry_counts(case, wrong):
    spaces, net, symmetry = CASES[case]
    network, obs = network_of(spaces, net), observations(spaces)
    image = mirrored(network, replace(symmetry, **wrong))
    with pytest.raises(AssertionError):
        assert_same(image.policy(obs), in_mirror(network.policy(symmetry.observe(obs)), symmetry))


@pytest.mark.parametrize("case", ["continuous", "numbered", "car"])
@torch.no_grad()
def test_both_views_are_the_same_in_the_mirror(case):
    spaces, net, symmetry = CASES[case]
    network, obs = network_of(spaces, net), observations(spaces)
    both = BothViews(network, mirrored(network, symmetry))
    assert_same(both.policy(obs), in_mirror(both.policy(symmetry.observe(obs)), symmetry))
    assert (both.spaces, both.net) == (spaces, network.net)


@torch.no_grad()
def test_both_views_have_the_mean_of_the_probabilities():
    spaces, net, symmetry = CASES["car"]
    network, obs = network_of(spaces, net), observations(spaces)
    image = mirrored(network, symmetry)
    mean = (network.policy(obs).log_probs.exp() + image.policy(obs).log_probs.exp()) / 2
    assert_close(BothViews(network, image).policy(obs).log_probs.exp(), mean)
