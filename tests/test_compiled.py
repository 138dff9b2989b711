"""The compiled update of dense networks against the plain one, which reads like the paper."""

from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose
from small_learners import learn_from_instances, learn_on_policy
from torch.testing import assert_close

from repaint_cli.errors import DivergedError
from repaint_cli.learn import side_by_side
from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.learn.rollout.observations import Observations
from repaint_cli.learn.update import epochs
from repaint_cli.learn.update.adam import RowAdam
from repaint_cli.learn.update.compiled import update as compiled
from repaint_cli.learn.update.compiled.kernels import tanh
from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.distributions import Categorical, Gaussian
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.spaces import Spaces
from repaint_cli.settings import PPOConfig

PLAIN = PPOConfig(
    compiled=False, n_epochs=3, minibatch_size=16, learning_rate=1e-2, ent_coef=0.03, vf_coef=0.7
)
HAND = PLAIN.model_copy(update={"compiled": True})
KINDS = pytest.mark.parametrize("discrete", [False, True], ids=["gaussian", "categorical"])
NET = NetConfig(hidden=(16, 12))
NETS = pytest.mark.parametrize(
    "net",
    [
        *(NetConfig(hidden=hidden) for hidden in [(), (8,), (16, 12), (8, 8, 8)]),
        NetConfig(hidden=(8,), value_hidden=(16, 12), obs_clip=1.0, obs_min_std=0),
    ],
    ids=lambda net: f"{net.hidden} {net.value_hidden}",
)


def learner(discrete, net=NET, n_seeds=3):
    """Students whose policies are not near uniform, after some observations, and their Adam."""
    student = ActorCritic(Spaces((5,), 3, discrete=discrete), net, n_seeds)
    rngs = [np.random.default_rng(s) for s in range(n_seeds)]
    student.initialize(rngs)
    for s, rng in enumerate(rngs):
        student.normalizer.update(s, torch.from_numpy(rng.normal(1, 2, (50, 5))))
    student.weights["policy.head.weight"].data.mul_(50)
    if not discrete:
        student.weights["policy.log_std"].data.uniform_(-1, 0.5, generator=torch.manual_seed(1))
    return student, RowAdam(student, PLAIN.learning_rate)


def samples(discrete, *counts, net=NET, seed=0):
    """Samples with ratios inside and on both sides of the clip range, Â of both signs."""
    rng, longest = np.random.default_rng(seed), max(counts)

    def draw(*shape):
        return torch.from_numpy(rng.normal(size=(len(counts), longest, *shape)).astype(np.float32))

    obs, actions = 2 * draw(5) + 1, draw(3)
    if discrete:
        actions = actions.argmax(-1)
    with torch.no_grad():
        log_probs = learner(discrete, net, len(counts))[0].policy(obs).log_prob(actions)
    return Samples(
        observations=Observations(list(obs)),
        rows=torch.arange(longest).repeat(len(counts), 1),
        actions=actions,
        behavior_log_probs=log_probs + 0.3 * draw(),
        advantages=draw(),
        returns=draw(),
        rewards=draw(),
        counts=torch.tensor(counts),
    )


def teacher(discrete, like):
    rng = torch.manual_seed(3)
    numbers = torch.randn(*like.rows.shape, 3, generator=rng)
    if discrete:
        return Categorical.from_logits(numbers)
    return Gaussian(numbers, torch.randn(len(numbers), 1, 3, generator=rng) / 3)


def rngs(n=3):
    return [np.random.default_rng(10 + s) for s in range(n)]


def both(discrete, net, learn):
    """Learn twice, plain and by hand; return the metrics and the learner of each."""
    metrics, learned = [], []
    for ppo, by_other_means in (
        (PLAIN, patch.object(compiled, "take_steps")),
        (HAND, no_autograd()),
    ):
        student, optimizer = learner(discrete, net)
        with by_other_means as never:
            metrics.append(learn(student, optimizer, ppo))
        never.assert_not_called()
        learned.append((student, optimizer))
    return metrics, learned


def no_autograd():
    return patch.object(epochs, "follow")


def assert_same(metrics, learned, atol=1e-5):
    (plain, adam), (hand, hand_adam) = learned
    assert metrics[0].keys() == metrics[1].keys()
    for name in metrics[0]:
        assert_allclose(metrics[1][name], metrics[0][name], rtol=1e-5, atol=1e-6, err_msg=name)
    assert_close(hand.storage, plain.storage, rtol=0, atol=atol)
    assert_close(hand_adam.steps, adam.steps)


@KINDS
@NETS
@pytest.mark.parametrize("beta", [0.0, 0.7])
def test_a_step_has_the_gradients_of_the_plain_one(discrete, net, beta):
    batch = samples(discrete, 16, 16, 16, net=net)
    advice = teacher(discrete, batch) if beta else None

    def learn(student, optimizer, ppo):
        once = ppo.model_copy(update={"n_epochs": 1})
        return learn_on_policy(
            student, optimizer, batch, once, rngs(), teacher=advice, beta=beta, policy_scale=0.5
        )

    metrics, learned = both(discrete, net, learn)
    assert 0.2 < metrics[0]["clip_fraction"].mean() < 0.8
    assert_close(learned[1][0].gradients, learned[0][0].gradients, rtol=1e-5, atol=1e-6)
    assert learned[0][0].gradients.abs().max() > 0.1
    assert_same(metrics, learned, atol=5e-6)


@KINDS
@NETS
def test_an_update_ends_where_the_plain_one_does_with_unequal_counts(discrete, net):
    batch = samples(discrete, 50, 33, 7, net=net)
    advice = teacher(discrete, batch)

    def learn(student, optimizer, ppo):
        return learn_on_policy(student, optimizer, batch, ppo, rngs(), teacher=advice, beta=0.3)

    metrics, learned = both(discrete, net, learn)
    assert_same(metrics, learned)
    assert learned[1][1].steps[0].tolist() == [12, 9, 3]


@KINDS
def test_instances_move_policies_alone_and_a_seed_without_any_stays(discrete):
    batch = samples(discrete, 40, 0, 9)

    def learn(student, optimizer, ppo):
        return learn_from_instances(student, optimizer, batch, ppo, rngs(), policy_scale=0.3)

    metrics, learned = both(discrete, NET, learn)
    assert_same(metrics, learned)
    untouched, _ = learner(discrete)
    hand, optimizer = learned[1]
    assert_close(hand.storage[1], untouched.storage[1], rtol=0, atol=0)
    assert_close(hand.storage[:, hand.n_policy :], untouched.storage[:, hand.n_policy :])
    assert optimizer.steps.tolist() == [[9, 0, 3], [0, 0, 0]]
    assert np.isnan(metrics[1]["policy_loss"][1])


def norms(student):
    """Lengths of the gradients of policies and critics, (2, S)."""
    cut = student.n_policy
    halves = student.gradients[:, :cut], student.gradients[:, cut:]
    return torch.stack([half.double().norm(dim=1) for half in halves])


@KINDS
@NETS
def test_a_gradient_that_is_too_long_is_scaled_down_by_itself(discrete, net):
    batch, once = samples(discrete, 16, 16, 16, net=net), {"n_epochs": 1}

    def learn(student, optimizer, ppo):
        return learn_on_policy(student, optimizer, batch, ppo, rngs())

    whole, clipped = (
        both(
            discrete, net,
            lambda *of, more=more: learn(*of[:2], of[2].model_copy(update=once | more)),
        )
        for more in ({}, {"max_grad_norm": 0.4})
    )  # fmt: skip
    long = norms(whole[1][0][0])
    assert 0 < (long > 0.4).float().mean() <= 1
    assert_same(*clipped, atol=5e-6)
    for student, _ in clipped[1]:
        assert_close(norms(student), long.clamp(max=0.4), rtol=1e-5, atol=1e-6)


@KINDS
def test_scaled_down_updates_end_where_the_plain_ones_do(discrete):
    batch, kept = samples(discrete, 50, 33, 7), samples(discrete, 40, 0, 9, seed=5)

    def learn(student, optimizer, ppo):
        ppo = ppo.model_copy(update={"max_grad_norm": 0.05})
        metrics = learn_on_policy(student, optimizer, batch, ppo, rngs())
        learn_from_instances(student, optimizer, kept, ppo, rngs())
        return metrics

    metrics, learned = both(discrete, NET, learn)
    assert_same(metrics, learned, atol=5e-5)
    assert norms(learned[1][0])[0, [0, 2]].tolist() == pytest.approx([0.05] * 2, rel=1e-4)
    student, optimizer = learner(discrete)
    learn_on_policy(student, optimizer, batch, HAND, rngs())
    learn_from_instances(student, optimizer, kept, HAND, rngs())
    assert not torch.allclose(student.storage, learned[1][0].storage, atol=1e-2)


@pytest.mark.parametrize("ppo", [PLAIN, HAND], ids=["plain", "by hand"])
@KINDS
def test_a_norm_that_no_gradient_reaches_changes_no_bit(discrete, ppo):
    batch, ended = samples(discrete, 50, 33, 7), []
    for longest in (None, 1e9):
        student, optimizer = learner(discrete)
        same = ppo.model_copy(update={"max_grad_norm": longest})
        learn_on_policy(student, optimizer, batch, same, rngs())
        ended.append(student.storage)
    assert torch.equal(*ended)


@KINDS
def test_updates_of_both_kinds_may_take_turns(discrete):
    """Adam's moments and counts are the same buffers for both."""
    batch, kept = samples(discrete, 40, 40, 40), samples(discrete, 20, 11, 16, seed=5)
    metrics, learned = [], []
    for ppo in (PLAIN, HAND):
        student, optimizer = learner(discrete)
        learn_on_policy(student, optimizer, batch, ppo, rngs())
        learn_from_instances(student, optimizer, kept, PLAIN, rngs())
        metrics.append(learn_on_policy(student, optimizer, batch, ppo, rngs()))
        learned.append((student, optimizer))
    assert_same(metrics, learned, atol=5e-5)


def test_a_joint_update_is_the_plain_one():
    batch, kept = samples(False, 20, 20, 20), samples(False, 5, 4, 3, seed=5)
    with patch.object(compiled, "take_steps") as never:
        student, _ = learner(False)
        optimizer = RowAdam(student, PLAIN.learning_rate, joint=True)
        learn_on_policy(student, optimizer, batch, HAND, rngs(), instances=kept)
    never.assert_not_called()
    assert optimizer.steps[0].tolist() == [6, 6, 6]


@KINDS
def test_without_a_teacher_beta_is_nothing(discrete):
    batch = samples(discrete, 20, 20, 20)

    def learn(student, optimizer, ppo):
        return learn_on_policy(student, optimizer, batch, ppo, rngs(), beta=0.7)

    assert_same(*both(discrete, NET, learn))


def test_a_minibatch_larger_than_the_samples_takes_no_more_room_than_they():
    batch = samples(False, 20, 7, 3)

    ended = []
    for size in (20, 10**12):
        student, optimizer = learner(False)
        whole = HAND.model_copy(update={"minibatch_size": size})
        learn_on_policy(student, optimizer, batch, whole, rngs())
        ended.append(student.storage)
    assert torch.equal(*ended)


@KINDS
def test_the_number_of_threads_changes_nothing(discrete):
    batch, ended = samples(discrete, 40, 30, 20), []
    for threads in (1, 2):
        with patch.object(side_by_side, "cores", return_value=threads):
            student, optimizer = learner(discrete)
            learn_on_policy(student, optimizer, batch, HAND, rngs())
            ended.append(student.storage)
    assert torch.equal(*ended)


@pytest.mark.parametrize(
    ("part", "name"), [("returns", "value_loss"), ("advantages", "policy_loss")]
)
def test_a_loss_that_is_not_finite_is_named_with_its_seed(part, name):
    batch = samples(False, 40, 40, 40)
    numbers = getattr(batch, part).clone()
    numbers[1, 17] = torch.inf
    student, optimizer = learner(False)
    with pytest.raises(DivergedError, match=f"expected a finite {name}, found") as caught:
        learn_on_policy(student, optimizer, replace(batch, **{part: numbers}), HAND, rngs())
    assert caught.value.row == 1


def test_tanh_is_tanh():
    x = np.concatenate([np.linspace(-12, 12, 4001), [1e-6, -1e-4, 50, -1e30, np.inf]])
    x = x.astype(np.float32)
    assert_allclose([tanh(number) for number in x], np.tanh(x.astype(float)), rtol=3e-7)
    assert np.isnan(tanh(np.float32(np.nan)))


@pytest.mark.parametrize("activation", ["relu", "elu"])
def test_networks_without_tanh_learn_as_written(activation):
    net, batch = NET.model_copy(update={"activation": activation}), samples(False, 16, 16, 16)
    student, optimizer = learner(False, net)
    before = student.storage.clone()
    with patch.object(compiled, "take_steps") as never:
        learn_on_policy(student, optimizer, batch, HAND, rngs())
        learn_from_instances(student, optimizer, batch, HAND, rngs())
    never.assert_not_called()
    assert (student.storage != before).float().mean() > 0.9


@KINDS
def test_both_stop_a_policy_whose_kl_is_above_the_target(discrete):
    """Seed by seed, after the first epoch that is; critics and the others' policies go on."""
    batch, moved = samples(discrete, 40, 33, 64), {}
    far = batch.advantages.clone()
    far[1] *= 0.0  # seed 1 has no slope, and acted by its policy: it stays where it is
    student, _ = learner(discrete)
    own = batch.behavior_log_probs.clone()
    with torch.no_grad():
        policy = student.policy(batch.observations.take(batch.rows))
        own[1] = policy.log_prob(batch.actions)[1]
    batch = replace(batch, advantages=far, behavior_log_probs=own)
    for name, ppo in (("plain", PLAIN), ("hand", HAND)):
        for limit in (None, 1e-6, 1e6):
            student, optimizer = learner(discrete)
            numbers = ppo.model_copy(update={"target_kl": limit, "n_epochs": 4, "ent_coef": 0.0})
            rngs = [np.random.default_rng(s) for s in range(3)]
            metrics = learn_on_policy(student, optimizer, batch, numbers, rngs)
            moved[name, limit] = student.storage.clone(), optimizer.steps.clone().numpy(), metrics
    steps = {limit: moved["plain", limit][1] for limit in (None, 1e-6, 1e6)}
    assert (steps[None] == steps[1e6]).all()
    assert (steps[None][1] == steps[1e-6][1]).all()  # critics
    assert (steps[1e-6][0] <= steps[None][0]).all()
    assert steps[1e-6][0, 1] == steps[None][0, 1]  # seed 1 is not stopped by the others
    assert steps[1e-6][0, 0] == 3  # one epoch of 40 samples in minibatches of 16
    for limit in (None, 1e-6, 1e6):
        plain, hand = moved["plain", limit], moved["hand", limit]
        assert_close(plain[0], hand[0], rtol=5e-5, atol=5e-5)
        assert np.array_equal(plain[1], hand[1])
        for name, values in plain[2].items():
            assert_allclose(hand[2][name], values, rtol=1e-3, atol=1e-5, err_msg=name)
