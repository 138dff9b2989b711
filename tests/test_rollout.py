import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from small_learners import learner_of
from small_tasks import guess, reach, scripted
from torch.testing import assert_close

from repaint_cli.errors import DivergedError
from repaint_cli.learn.rollout.collect import collect, start
from repaint_cli.learn.rollout.observations import Observations
from repaint_cli.learn.seeding import Purpose
from repaint_cli.policies.distributions import Categorical, Gaussian
from repaint_cli.settings import PPOConfig
from repaint_cli.tasks.card_files import read_task

NAN = float("nan")


def generators(n):
    return [np.random.default_rng(s) for s in range(n)]


def gaussian(mean=0.0, std=1.0):
    """A policy that looks at nothing."""

    def policy(obs, counts):
        means = torch.full((*obs.shape[:2], 1), mean)
        return Gaussian(means, torch.full((len(obs), 1, 1), std).log())

    return policy


def counting(t, n, width=1):
    """Observations (t+1, n, width) that say when and where they are: 100·t + n."""
    numbers = 100.0 * np.arange(t + 1)[:, None] + np.arange(n)
    return np.repeat(numbers[..., None], width, axis=2)


def seen(rollout, s=0):
    """What seed s saw, (T+1, N, *O)."""
    return rollout.observations.stores[s].numpy()[rollout.index[:, s]]


def test_the_last_observation_of_an_episode_is_the_true_one():
    # 0 until an episode's last step, then 1; the step after it resets, whatever the action
    obs = np.array([0.0, 0, 1, 0, 0, 0, 1, 0, 0]).reshape(-1, 1, 1)
    env, first = scripted(obs, np.ones((8, 1)), ends=[(1, 0), (5, 0)])
    rollout = collect(env, first, gaussian(), generators(1), n_steps=6)
    assert_array_equal(rollout.valid[:, 0, 0], [1, 1, 0, 1, 1, 1, 0, 1])
    followed = seen(rollout)[1:, 0, 0]
    assert_array_equal(followed[rollout.truncations[:, 0, 0]], [1, 1])
    assert_array_equal(followed[rollout.valid[:, 0, 0]], [0, 1, 0, 0, 1, 0])


def test_a_rollout_says_what_happened_where():
    env, first = scripted(counting(3, 4), np.arange(12.0).reshape(3, 4), ends=[(0, 3)])
    rollout = collect(env, first, gaussian(), generators(2), n_steps=5)
    for s in range(2):
        assert_allclose(seen(rollout, s)[0, :, 0], counting(3, 4)[0, 2 * s : 2 * s + 2, 0])
    assert_array_equal(rollout.rewards[:, 1], [[2, 3], [6, 0], [10, 11]])  # a reset pays nothing
    assert_array_equal(rollout.reward_terms[..., 0], rollout.rewards)
    assert_array_equal(rollout.truncations[:, 1], [[0, 1], [0, 0], [0, 0]])
    assert_array_equal(rollout.valid[:, 0], [[1, 1], [1, 1], [1, 0]])
    assert_array_equal(rollout.valid[:, 1], [[1, 1], [1, 0], [1, 1]])


@given(st.integers(1, 3), st.integers(1, 4), st.integers(1, 20), st.integers(0, 2**32 - 1))
def test_every_seed_gets_exactly_n_steps_and_no_resetting_step(n_seeds, n_envs, n_steps, seed):
    length, width = 2 * n_steps + 2, n_seeds * n_envs
    ends = np.argwhere(np.random.default_rng(seed).random((length, width)) < 0.3)
    ends = [(t, n) for t, n in ends.tolist() if [t - 1, n] not in ends.tolist()]
    env, first = scripted(counting(length, width), np.ones((length, width)), ends)
    rollout = collect(env, first, gaussian(), generators(n_seeds), n_steps=n_steps)
    assert_array_equal(rollout.valid.sum((0, 2)), n_steps)
    assert not (rollout.valid[1:] & rollout.truncations[:-1]).any()
    for s in range(n_seeds):
        there = counting(len(rollout.valid) - 1, width)[..., 0]
        there = there[:, s * n_envs : (s + 1) * n_envs]
        valid = rollout.valid[:, s]
        assert_array_equal(seen(rollout, s)[:-1, :, 0][valid], there[valid])
        assert_array_equal(seen(rollout, s)[1:, :, 0][valid], there[valid] + 100)


def test_without_a_number_of_steps_every_environment_plays_one_episode():
    ends = [(t, n) for t in range(9) for n, length in enumerate((3, 1, 2, 4)) if t >= length - 1]
    env, first = scripted(counting(9, 4), np.ones((9, 4)), ends)
    rollout = collect(env, first, gaussian(), generators(2))
    assert_array_equal(rollout.valid.sum(0), [[3, 1], [2, 4]])
    seeds, returns, lengths = rollout.episodes()
    assert_array_equal(np.sort(lengths[seeds == 0]), [1, 3])
    assert_array_equal(np.sort(lengths[seeds == 1]), [2, 4])
    assert_array_equal(returns, lengths)


def test_what_a_parked_environment_says_is_not_read():
    obs, rewards = counting(4, 2), np.ones((4, 2))
    obs[2:, 0], rewards[1:, 0] = NAN, NAN
    env, first = scripted(obs, rewards, ends=[(0, 0), (3, 1)], terminated=True)
    rollout = collect(env, first, gaussian(), generators(1))
    assert_array_equal(rollout.valid[:, 0].sum(0), [1, 4])
    assert rollout.observations.stores[0].isfinite().all()


@pytest.mark.parametrize("bad", [NAN, np.inf])
@pytest.mark.parametrize("n_steps", [8, None], ids=["steps", "episodes"])
def test_an_observation_that_is_not_finite_is_named(bad, n_steps):
    obs = counting(8, 4, width=3)
    obs[2, 3, 1] = bad
    env, first = scripted(obs, np.ones((8, 4)))
    message = "an observation that is not, in environment 1 at step 2"
    with pytest.raises(DivergedError, match=message) as caught:
        collect(env, first, gaussian(), generators(2), n_steps=n_steps)
    assert caught.value.row == 1


def test_opposite_infinities_are_not_finite_either():
    obs = counting(8, 4, width=3)
    obs[2, 1], obs[2, 2] = np.inf, -np.inf
    env, first = scripted(obs, np.ones((8, 4)))
    with pytest.raises(DivergedError, match="in environment 1 at step 2") as caught:
        collect(env, first, gaussian(), generators(2), n_steps=8)
    assert caught.value.row == 0


def test_what_need_not_be_finite_is_not_looked_at():
    obs = counting(8, 2, width=3)
    obs[6:, 1] = NAN
    env, first = scripted(obs, np.ones((8, 2)), ends=[(2, 1), (7, 0)], terminated=True)
    rollout = collect(env, first, gaussian(), generators(1))
    assert rollout.observations.stores[0].isfinite().all()


@pytest.mark.parametrize("image", [False, True])
def test_acting_takes_one_thread_and_gives_the_others_back(image):
    before, used = torch.get_num_threads(), []

    def policy(obs, counts):
        used.append(torch.get_num_threads())
        if len(used) > 1:
            raise RuntimeError("no more")
        return Categorical.from_logits(torch.zeros(*obs.shape[:2], 3))

    obs = np.zeros((9, 2, 4, 4, 1), np.uint8) if image else np.zeros((9, 2, 3))
    env, first = scripted(obs, np.ones((8, 2)), discrete=3)
    torch.set_num_threads(2)
    try:
        with pytest.raises(RuntimeError, match="no more"):
            collect(env, first, policy, generators(1), n_steps=8)
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)
    assert used == [1, 1]


def test_an_episodes_last_observation_has_to_be_finite_too():
    obs = counting(8, 1)
    obs[2] = NAN
    env, first = scripted(obs, np.ones((8, 1)), ends=[(1, 0)])
    with pytest.raises(DivergedError, match=r"observation .* at step 2"):
        collect(env, first, gaussian(), generators(1), n_steps=6)


def test_a_reward_that_is_not_finite_is_named():
    rewards = np.ones((8, 4))
    rewards[5, 2] = NAN
    env, first = scripted(counting(8, 4), rewards)
    message = "a reward that is not, in environment 0 at step 5"
    with pytest.raises(DivergedError, match=message) as caught:
        collect(env, first, gaussian(), generators(2), n_steps=16)
    assert caught.value.row == 1


def test_actions_are_clipped_for_the_environment_and_for_nobody_else():
    env, first = scripted(counting(3, 2), np.ones((3, 2)))
    policy = gaussian(mean=5.0, std=0.1)
    rollout = collect(env, first, policy, generators(1), n_steps=6)
    assert_array_equal(env.unwrapped.actions, np.ones((3, 2, 1)))
    assert (rollout.actions > 4).all()
    actions = torch.from_numpy(rollout.actions[0])
    expected = policy(actions, [2]).log_prob(actions)
    assert_close(torch.from_numpy(rollout.behavior_log_probs[0]), expected)


def test_discrete_actions_arrive_as_they_are():
    def cycle(obs, counts):
        return Categorical.from_logits(100.0 * torch.eye(3)[obs[..., 0].long() // 100 % 3])

    env, first = scripted(counting(6, 2), np.ones((6, 2)), discrete=3)
    collect(env, first, cycle, generators(1), n_steps=12)
    assert_array_equal(env.unwrapped.actions, np.repeat(np.arange(6) % 3, 2).reshape(6, 2))


def test_greedy_takes_the_mode():
    env, first = scripted(counting(3, 2), np.ones((3, 2)))
    rollout = collect(env, first, gaussian(0.5), generators(1), n_steps=6, greedy=True)
    assert_array_equal(rollout.actions, np.full((3, 1, 2, 1), 0.5))


def test_noise_is_each_seeds_own_and_never_comes_again():
    def actions(rngs):
        env, first = scripted(counting(150, 2 * len(rngs)), np.ones((150, 2 * len(rngs))))
        return collect(env, first, gaussian(), rngs, n_steps=300).actions

    together, alone = actions(generators(3)), actions(generators(3)[1:2])
    assert_array_equal(together[:, 1], alone[:, 0])
    assert len(np.unique(together)) == together.size


def test_what_was_asked_for_is_recorded():
    env, first = scripted(counting(3, 2), np.arange(6.0).reshape(3, 2))
    rollout = collect(env, first, gaussian(), generators(2), n_steps=3, record=("pay",))
    assert_array_equal(rollout.records["pay"], np.arange(6.0).reshape(3, 2, 1))


def test_images_are_stored_once_as_bytes_and_only_those_that_count_are_looked_at():
    # image value 10·t + n; environment 0 ends at once, 1 after three steps, 2 and 3 after two
    obs = np.uint8(10 * np.arange(7)[:, None] + np.arange(4))[..., None, None, None]
    looked = []

    def policy(obs, counts):
        looked.append([obs[s, :n].flatten().tolist() for s, n in enumerate(counts)])
        return Gaussian(obs.flatten(2).float() / 100, torch.full((2, 1, 1), -7.0))

    ends = [(0, 0), (2, 1), (1, 2), (1, 3)]
    env, first = scripted(obs, np.ones((6, 4)), ends)
    rollout = collect(env, first, policy, generators(2))
    assert looked == [[[0, 1], [2, 3]], [[11], [12, 13]], [[21], []]]
    for t, actions in enumerate(np.array(env.unwrapped.actions)[..., 0]):
        valid = rollout.valid[t].flatten()
        means = obs[t, :, 0, 0, 0][valid] / 100
        assert_allclose(actions[valid], means, atol=5e-3)
        z = (actions[valid] - means) * np.exp(7)
        log_probs = rollout.behavior_log_probs[t].flatten()[valid]
        assert_allclose(log_probs, 7 - z**2 / 2 - np.log(2 * np.pi) / 2, atol=1e-3)
    first_store, second_store = rollout.observations.stores
    assert first_store.dtype == torch.uint8
    assert first_store.flatten().tolist() == [0, 1, 10, 11, 21, 31]
    assert second_store.flatten().tolist() == [2, 3, 12, 13, 22, 23]


def test_frames_are_taken_seed_by_seed():
    for shape in ((3,), (2, 2, 1)):  # vectors, images
        stores = [torch.randn(n, *shape) for n in (4, 2)]
        rows = torch.tensor([[3, 0, 3], [1, 1, 0]])
        found = Observations(stores).take(rows)
        for s in range(2):
            assert torch.equal(found[s], stores[s][rows[s]])


def test_only_episodes_that_ended_are_counted():
    ends = [(1, 0), (3, 0), (2, 1)]
    env, first = scripted(counting(6, 2), np.arange(12.0).reshape(6, 2), ends)
    rollout = collect(env, first, gaussian(), generators(2), n_steps=4)
    seeds, returns, lengths = rollout.episodes()
    # 0 2 | reset | 6 | reset | 10 goes on, and 1 3 5 | reset | 9 goes on
    assert sorted(zip(seeds, returns, lengths, strict=True)) == [(0, 2, 2), (0, 6, 1), (1, 9, 3)]


def test_a_rollout_without_an_end_has_no_episodes():
    env, first = scripted(counting(2, 1), np.ones((2, 1)))
    parts = collect(env, first, gaussian(), generators(1), n_steps=2).episodes()
    assert [len(part) for part in parts] == [0, 0, 0]


def first_observations(seeds, purpose=Purpose.TRAIN, iteration=1, task=None):
    env, obs = start(task or guess(), seeds, 8, purpose, iteration)
    env.close()
    return obs.reshape(len(seeds), 8, -1)


def test_environments_start_where_seed_purpose_and_iteration_say():
    first = first_observations([3, 4])
    assert_array_equal(first, first_observations([3, 4]))
    assert_array_equal(first[1:], first_observations([4]))
    for other in (
        first_observations([5, 6]),
        first_observations([3, 4], Purpose.TEACHER),
        first_observations([3, 4], iteration=2),
        first[::-1],
    ):
        assert (first != other).any()


def test_time_limits_truncate_and_steps_are_counted():
    task = reach()
    env, obs = start(task, [0, 1], 4, Purpose.TRAIN, 1)
    rollout = collect(env, obs, gaussian(), generators(2), n_steps=72)
    assert not rollout.terminations.any()
    assert_array_equal(rollout.valid.sum((0, 2)), 72)
    assert_array_equal(rollout.episodes()[2], 8)
    assert len(rollout.episodes()[0]) == 16


def test_whole_episodes_are_played_out_and_none_begins_once_there_is_enough():
    # environment 0 ends after steps 2 and 5, environment 1 after step 4
    ends = [(1, 0), (4, 0), (3, 1)]
    env, first = scripted(counting(8, 2), np.ones((8, 2)), ends)
    rollout = collect(env, first, gaussian(), generators(1), n_steps=6, whole=True)
    # six are there after the fourth step, while environment 0 is in its second episode
    assert rollout.valid[:, 0, 0].tolist() == [True, True, False, True, True]
    assert rollout.valid[:, 0, 1].tolist() == [True, True, True, True, False]
    assert rollout.episodes()[2].tolist() == [2, 4, 2]


def test_an_environment_that_has_just_begun_again_does_not_start_an_episode_it_need_not():
    env, first = scripted(counting(8, 2), np.ones((8, 2)), [(1, 0), (2, 1), (5, 0), (6, 1)])
    rollout = collect(env, first, gaussian(), generators(1), n_steps=5, whole=True)
    assert rollout.valid[:, 0].sum(0).tolist() == [2, 3]


def test_a_seed_whose_episodes_are_long_plays_fewer_of_them():
    task = guess(n_episodes=12, max_steps=60)
    learner = learner_of(task, (0, 1, 2))
    learner.episode_lengths = np.array([0.0, 6.0, 30.0])  # not known, short, long
    rollout = learner.collect(task, 1)
    assert [len(set(envs)) for envs in played(rollout)] == [12, 10, 5]
    lengths = learner.episode_lengths
    assert lengths.tolist() == rollout.mean_episodes()[1].tolist()
    again = learner.collect(task, 2)
    wanted = np.clip(np.floor(60 / lengths), 5, 12)
    assert [len(set(envs)) for envs in played(again)] == wanted.tolist()


def test_a_seed_plays_what_it_would_play_alone():
    """Its neighbours' episodes change neither how many it plays nor how they go."""
    task = guess(n_episodes=12, max_steps=60)
    both, alone = learner_of(task, (0, 1)), learner_of(task, (0,))
    both.episode_lengths, alone.episode_lengths = np.array([10.0, 6.0]), np.array([10.0])
    one, other = both.collect(task, 1), alone.collect(task, 1)
    n = int(other.valid.any((1, 2)).sum())
    assert np.array_equal(one.valid[:n, 0], other.valid[:n, 0])
    valid = other.valid[:n, 0]
    for name in ("actions", "rewards", "behavior_log_probs"):
        mine, his = (getattr(each, name)[:n, 0][valid] for each in (one, other))
        assert np.array_equal(mine, his), name


def test_fewer_episodes_begin_at_places_that_are_spread():
    task = read_task("racer-inner").with_settings(["ppo.max_steps=50", "env.max_steps=4"])
    learner = learner_of(task, (0,))
    learner.episode_lengths = np.array([10.0])
    rollout = learner.collect(task, 3)
    assert played(rollout) == [[3, 7, 11, 15, 19]]
    assert rollout.valid.sum() == 20  # 5 cars, 4 steps each
    starts = rollout.records["waypoint"][0, 0, [3, 7, 11, 15, 19]]
    assert len(set(starts)) == 5
    assert [len(own) for own in played(learner.collect(task, 4))] == [12]


def test_without_a_budget_all_episodes_are_played():
    task = guess(n_episodes=12)
    learner = learner_of(task, (0,))
    learner.episode_lengths = np.array([30.0])
    assert [len(set(envs)) for envs in played(learner.collect(task, 1))] == [12]


def test_a_budget_needs_episodes():
    with pytest.raises(ValueError, match="max_steps limits n_episodes, and there are none: n_st"):
        PPOConfig(max_steps=100)


def played(rollout):
    """The environments that took a step, by seed."""
    valid = rollout.valid.any(0)  # (S, N)
    return [np.flatnonzero(own).tolist() for own in valid]
