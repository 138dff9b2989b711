import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from torch.testing import assert_close

from repaint_cli.learn.rollout import gae as module
from repaint_cli.learn.rollout.batches import front
from repaint_cli.learn.rollout.gae import Samples, describe, gae, to_samples
from repaint_cli.learn.rollout.observations import Observations
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.spaces import Spaces
from repaint_cli.settings import PPOConfig

seeds = st.integers(0, 2**32 - 1)


def rolled(obs, rewards, *, terminated=(), truncated=(), invalid=()):
    """A rollout of arrays (T+1, S, N) and (T, S, N); marks are places (t, s, n)."""
    obs, rewards = np.array(obs, np.float32), np.array(rewards, float)
    marks = []
    for places in (terminated, truncated, invalid):
        marks.append(np.zeros(rewards.shape, bool))
        for place in places:
            marks[-1][place] = True
    index = np.empty(obs.shape, int)
    for s in range(obs.shape[1]):
        index[:, s] = np.arange(index[:, s].size).reshape(index[:, s].shape)
    return Rollout(
        observations=Observations(
            [torch.from_numpy(obs[:, s].reshape(-1, 1)) for s in range(obs.shape[1])]
        ),
        index=index,
        actions=rewards[..., None].astype(np.float32),
        behavior_log_probs=rewards.astype(np.float32),
        reward_terms=rewards[..., None],
        rewards=rewards,
        terminations=marks[0],
        truncations=marks[1],
        valid=~marks[2],
    )


def ppo(gamma, gae_lambda, **more):
    return PPOConfig(gamma=gamma, gae_lambda=gae_lambda, **more)


def one_env(column):
    return np.array(column, float).reshape(-1, 1, 1)


def critic(obs, counts):
    """V(s) is what is seen."""
    return obs[..., 0]


def samples_of(n_seeds=2, n=6, counts=None, seed=0):
    rng = np.random.default_rng(seed)
    floats = [torch.from_numpy(rng.normal(size=(n_seeds, n)).astype(np.float32)) for _ in range(4)]
    frames = Observations([torch.from_numpy(rng.normal(size=(9, 3)).astype(np.float32))] * n_seeds)
    rows = torch.from_numpy(rng.integers(9, size=(n_seeds, n)))
    actions = torch.from_numpy(rng.normal(size=(n_seeds, n, 2)).astype(np.float32))
    return Samples(frames, rows, actions, *floats, torch.tensor(counts or [n] * n_seeds))


def test_gae_with_gamma_one_tenth_writes_the_rewards_as_digits():
    # rewards 1 2 3 | 4 5, terminated after 3, truncated after 5 with V(final) = 7
    found = gae(
        rewards=np.array([1.0, 2.0, 3.0, 4.0, 5.0]),
        values=np.zeros(5),
        next_values=np.array([0.0, 0.0, 9.0, 0.0, 7.0]),
        terminations=np.array([0, 0, 1, 0, 0], bool),
        ends=np.array([0, 0, 1, 0, 1], bool),
        gamma=0.1,
        gae_lambda=1.0,
    )
    assert_allclose(found, [1.23, 2.3, 3.0, 4.57, 5.7])


def test_gae_by_hand_with_a_critic():
    # γ = λ = ½, V = 2, 4 and V(last) = 8, no end: δ₁ = 6 + 4 − 4 = 6, δ₀ = 1 + 2 − 2 = 1, 1 + ¼·6
    ends = np.zeros(2, bool)
    values, following = np.array([2.0, 4.0]), np.array([4.0, 8.0])
    assert_allclose(gae(np.array([1.0, 6.0]), values, following, ends, ends, 0.5, 0.5), [2.5, 6.0])


def any_arrays(seed, t=7):
    rng = np.random.default_rng(seed)
    rewards, values, following = rng.normal(size=(3, t, 2))
    ends = rng.random((t, 2)) < 0.3
    return rewards, values, following, ends & (rng.random((t, 2)) < 0.5), ends


@given(seeds, st.floats(0.1, 1), st.floats(0, 1))
def test_gae_is_the_sum_of_discounted_td_errors_up_to_the_end(seed, gamma, gae_lambda):
    rewards, values, following, terminations, ends = arrays = any_arrays(seed)
    deltas = rewards + gamma * (1 - terminations) * following - values
    expected = np.zeros_like(deltas)
    for start, n in np.ndindex(deltas.shape):
        for t in range(start, len(deltas)):
            expected[start, n] += (gamma * gae_lambda) ** (t - start) * deltas[t, n]
            if ends[t, n]:
                break
    assert_allclose(gae(*arrays, gamma, gae_lambda), expected, atol=1e-12)


def test_lambda_zero_is_the_td_error():
    rewards, values, following, terminations, ends = any_arrays(0)
    expected = rewards + 0.9 * np.where(terminations, 0, following) - values
    assert_allclose(gae(rewards, values, following, terminations, ends, 0.9, 0.0), expected)


@given(seeds, st.integers(0, 5))
def test_what_follows_a_done_cannot_change_what_precedes_it(seed, end):
    one, other = any_arrays(seed), any_arrays(seed + 1)
    for ends in (one[4], other[4]):
        ends[end] = True
    mixed = [np.concatenate([a[: end + 1], b[end + 1 :]]) for a, b in zip(one, other, strict=True)]
    before = gae(*one, 0.9, 0.9)[: end + 1]
    assert_array_equal(gae(*mixed, 0.9, 0.9)[: end + 1], before)


def test_a_terminated_episode_is_worth_no_more_a_truncated_one_goes_on():
    obs, rewards = one_env([0, 0, 7]), one_env([1, 2])
    for mark, expected in (("terminated", [1.2, 2.0]), ("truncated", [1.27, 2.7])):
        samples = to_samples(rolled(obs, rewards, **{mark: [(1, 0, 0)]}), critic, ppo(0.1, 1.0))
        assert_close(samples.advantages, torch.tensor([expected]))


def test_the_end_of_the_rollout_bootstraps_as_a_time_limit_does():
    samples = to_samples(rolled(one_env([0, 0, 7]), one_env([1, 2])), critic, ppo(0.1, 1.0))
    assert_close(samples.advantages, torch.tensor([[1.27, 2.7]]))


@pytest.mark.parametrize(("mark", "first"), [("terminated", [1.2, 2]), ("truncated", [1.27, 2.7])])
def test_the_step_that_resets_is_no_sample_and_joins_no_episodes(mark, first):
    # episode one sees 0 0 and ends in 7; the step from 7 to 0 only resets and pays 100; then 0 0 5
    rollout = rolled(
        one_env([0, 0, 7, 0, 0, 5]),
        one_env([1, 2, 100, 3, 4]),
        **{mark: [(1, 0, 0)]},
        invalid=[(2, 0, 0)],
    )
    samples = to_samples(rollout, critic, ppo(0.1, 1.0))
    assert_close(samples.advantages, torch.tensor([[*first, 3.45, 4.5]]))
    assert samples.rewards.tolist() == [[1, 2, 3, 4]]
    assert samples.counts.tolist() == [4]


def test_an_environment_cut_off_early_bootstraps_from_what_it_saw_last():
    # two environments; the second has no place in the last step of the rollout
    obs = [[[0.0, 0.0]], [[0.0, 8.0]], [[7.0, 9.0]]]
    rollout = rolled(obs, [[[1.0, 3.0]], [[2.0, 100.0]]], invalid=[(1, 0, 1)])
    samples = to_samples(rollout, critic, ppo(0.1, 1.0))
    assert_close(samples.advantages, torch.tensor([[1.27, 3.8, 2.7]]))


def test_returns_are_advantages_plus_values():
    samples = to_samples(rolled(one_env([5, 6, 7]), one_env([1, 2])), critic, ppo(0.1, 1.0))
    assert_close(samples.returns, samples.advantages + torch.tensor([[5.0, 6.0]]))
    assert_close(samples.returns, torch.tensor([[1.27, 2.7]]))


def test_every_sample_keeps_what_belongs_to_it_and_seeds_may_have_unequal_numbers():
    obs = np.arange(12.0).reshape(3, 2, 2)  # number 4t + 2s + n
    rewards = 100 + obs[:2]
    rollout = rolled(obs, rewards, invalid=[(0, 1, 0), (1, 1, 1)])
    samples = to_samples(rollout, critic, ppo(0.9, 0.9))
    assert samples.counts.tolist() == [4, 2]
    seen = samples.observations.take(samples.rows)[..., 0]
    expected = torch.tensor([[0.0, 1.0, 4.0, 5.0], [3.0, 6.0, 0, 0]])
    real = samples.mask
    for found in (seen, samples.rewards - 100, samples.behavior_log_probs - 100):
        assert_close(found[real], expected[real])
    assert_close(samples.actions[..., 0][real] - 100, expected[real])


def test_samples_of_unequal_lengths_are_refused():
    samples = samples_of()
    parts = {name: getattr(samples, name) for name in Samples.__dataclass_fields__}
    with pytest.raises(ValueError, match=r"returns is \(2, 5\), rows are \(2, 6\)"):
        Samples(**parts | {"returns": samples.returns[:, :5]})


@given(seeds, st.lists(st.integers(1, 6), min_size=2, max_size=2))
def test_what_is_kept_keeps_its_order_and_each_seeds_own_number(seed, counts):
    samples = samples_of(counts=counts, seed=seed)
    kept = torch.from_numpy(np.random.default_rng(seed).random((2, 6)) < 0.5)
    found = samples.pick(*front(kept & samples.mask))
    for s, n in enumerate(counts):
        chosen = kept[s, :n]
        assert found.counts[s] == chosen.sum()
        for name in ("rows", "actions", "behavior_log_probs", "advantages", "returns", "rewards"):
            whole, rest = getattr(samples, name)[s, :n], getattr(found, name)[s]
            assert torch.equal(rest[: found.counts[s]], whole[chosen])


def test_keeping_nothing_leaves_nothing():
    found = samples_of().pick(*front(torch.zeros(2, 6, dtype=torch.bool)))
    assert found.counts.tolist() == [0, 0]
    assert found.mask.shape == (2, 0)


def test_a_network_sees_a_rollout_of_images_in_parts_and_says_the_same(monkeypatch):
    net = NetConfig(kind="cnn", conv=((4, 4, 2),), dense=8)
    student = ActorCritic(Spaces((12, 12, 1), 3, discrete=True), net, 2)
    student.initialize([np.random.default_rng(s) for s in range(2)])
    rng = np.random.default_rng(0)
    stores = [torch.from_numpy(rng.integers(0, 256, (n, 12, 12, 1), np.uint8)) for n in (11, 6)]
    rollout = rolled(np.zeros((6, 2, 1)), np.ones((5, 2, 1)), invalid=[(3, 1, 0), (4, 1, 0)])
    rollout = Rollout(**vars(rollout) | {"observations": Observations(stores)})
    tables, looked = [], []

    def value(obs, counts):
        looked.append(counts)
        return student.value(obs, counts)

    for chunk in (512, 2):
        monkeypatch.setattr(module, "CHUNK", chunk)
        samples = to_samples(rollout, value, ppo(0.9, 0.9))
        tables.append((samples, describe(student.policy, samples).log_probs))
    (whole, odds), (parts, same_odds) = tables
    assert whole.counts.tolist() == [5, 3]
    assert sorted(looked) == sorted([[11, 6], *[[2, 2]] * 3, *[[2, 0]] * 2, [1, 0]])
    assert_close(parts.returns, whole.returns)
    assert_close(same_odds[whole.mask], odds[whole.mask])
    assert not odds.requires_grad


def test_a_time_limit_may_be_terminal():
    rollout = rolled(one_env([0, 0, 7]), one_env([1, 2]), truncated=[(1, 0, 0)])
    samples = to_samples(rollout, critic, ppo(0.1, 1.0, time_limit="terminal"))
    assert_close(samples.advantages, torch.tensor([[1.2, 2.0]]))


def test_reinforce_is_the_return_less_a_baseline():
    rollout = rolled(one_env([5, 6, 7]), one_env([1, 2]), terminated=[(1, 0, 0)])
    samples = to_samples(rollout, critic, ppo(0.5, 0.0, objective="reinforce"))
    assert_close(samples.advantages, torch.tensor([[1 + 0.5 * 2 - 5, 2.0 - 6]]))


def test_the_first_samples_of_each_seed():
    samples = samples_of(counts=[6, 2]).first(4)
    assert samples.counts.tolist() == [4, 2]
    assert torch.equal(samples.rows, samples_of().rows[:, :4])


def test_batches_together_keep_order_and_what_each_sample_saw():
    parts = [samples_of(counts=[6, 2], seed=1), samples_of(counts=[1, 5], seed=2)]
    whole = Samples.concatenate(parts)
    assert whole.counts.tolist() == [7, 7]
    for s in range(2):
        for name in ("actions", "advantages", "rewards"):
            rows = [getattr(part, name)[s, : part.counts[s]] for part in parts]
            assert torch.equal(getattr(whole, name)[s], torch.cat(rows))
        seen = [part.observations.take(part.rows)[s, : part.counts[s]] for part in parts]
        assert torch.equal(whole.observations.take(whole.rows)[s], torch.cat(seen))
    assert Samples.concatenate(parts[:1]) is parts[0]
