"""Rewards divided by the running deviation of discounted returns."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from small_learners import learner_of, spaces_of, trained, training, untrained_teacher
from small_tasks import guess, reach

from repaint_cli.learn.learner import Learner
from repaint_cli.learn.rollout.gae import to_samples
from repaint_cli.learn.rollout.reward_scale import CLIP, RewardScale
from repaint_cli.policies.networks import ActorCritic

GAMMA = 0.9


def rollout_of(task, seeds=(0, 1)):
    return learner_of(task, seeds).collect(task, 1)


def returns_by_hand(rollout, s, before=None):
    """What each step's episode has earned until then, discounted."""
    steps, n_envs = rollout.valid.shape[0], rollout.valid.shape[2]
    earned, running = [], np.zeros(n_envs) if before is None else before
    for t in range(steps):
        for n in range(n_envs):
            if rollout.valid[t, s, n]:
                running[n] = GAMMA * running[n] + rollout.rewards[t, s, n]
                earned.append(running[n])
                if rollout.terminations[t, s, n] or rollout.truncations[t, s, n]:
                    running[n] = 0.0
    return np.array(earned)


@pytest.mark.parametrize("make", [reach, guess])
def test_the_deviation_is_that_of_discounted_returns(make):
    rollout, scale = rollout_of(make()), RewardScale(2)
    scale.update(rollout, GAMMA, continues=False)
    for s in range(2):
        earned = returns_by_hand(rollout, s)
        assert len(earned) > 20
        assert scale.var[s] == pytest.approx(earned.var(), rel=1e-3)
        wanted = np.clip(rollout.rewards[:, s] / earned.std(), -CLIP, CLIP)
        scaled = scale.applied(rollout).scaled_rewards[:, s]
        valid = rollout.valid[:, s]
        np.testing.assert_allclose(scaled[valid], wanted[valid], rtol=1e-3)


def test_episodes_that_go_on_keep_what_they_have_earned():
    rollout = rollout_of(reach())
    half = len(rollout.valid) // 2
    parts = [cut(rollout, slice(0, half)), cut(rollout, slice(half, None))]
    whole, continued, afresh = RewardScale(2), RewardScale(2), RewardScale(2)
    whole.update(rollout, GAMMA, continues=True)
    for part in parts:
        continued.update(part, GAMMA, continues=True)
        afresh.update(part, GAMMA, continues=False)
    np.testing.assert_allclose(continued.var, whole.var)
    np.testing.assert_allclose(continued.mean, whole.mean)
    assert not np.allclose(afresh.var, whole.var)


def cut(rollout, rows):
    names = ("rewards", "valid", "terminations", "truncations")
    return replace(rollout, **{name: getattr(rollout, name)[rows] for name in names})


def test_large_rewards_are_clipped():
    rollout, scale = rollout_of(reach()), RewardScale(2)
    scale.var[:] = 1e-6
    scaled = scale.applied(rollout).scaled_rewards
    assert np.abs(scaled[rollout.valid]).max() == CLIP


def test_what_is_learned_from_is_scaled_and_what_is_reported_is_not():
    task = reach(normalize_rewards=True)
    learner = learner_of(task, (0, 1))
    rollout = learner.collect(task, 1)
    plain = rollout_of(reach())
    np.testing.assert_array_equal(rollout.rewards, plain.rewards)
    critic, ppo = learner.student.value, task.ppo
    scaled, raw = to_samples(rollout, critic, ppo), to_samples(plain, critic, ppo)
    assert torch.equal(scaled.rewards, raw.rewards)
    assert not torch.allclose(scaled.returns, raw.returns)


def test_the_unit_of_the_reward_does_not_matter():
    """With rewards a thousand times as large the same is learned, also of a teacher's samples."""
    small, large = (
        reach(weight, normalize_rewards=True, n_iterations=4) for weight in (1.0, 1000.0)
    )
    runs = [trained(task, (0, 1), untrained_teacher(task, 2)) for task in (small, large)]
    (one, stats), (other, others) = runs
    torch.testing.assert_close(one.student.storage, other.student.storage, rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(
        1000 * stats[-2].metrics["episode_return"], others[-2].metrics["episode_return"], rtol=1e-3
    )
    plain, _ = trained(reach(1000.0, n_iterations=4), (0, 1))
    assert not torch.allclose(plain.student.storage, other.student.storage, rtol=1e-3, atol=1e-4)


def test_a_checkpoint_holds_the_statistics():
    scale = RewardScale(2)
    scale.update(rollout_of(reach()), GAMMA, continues=True)
    again = RewardScale.of_state(scale.state())
    for name in ("mean", "var", "count", "running"):
        np.testing.assert_array_equal(getattr(again, name), getattr(scale, name))


def test_without_it_there_are_no_statistics():
    task = reach(n_iterations=1)
    student = ActorCritic(spaces_of(task), task.net, 1)
    learner = Learner.fresh(student, [0], 1e-3)
    list(training(task, learner))
    assert learner.reward_scale is None
