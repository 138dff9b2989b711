import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from tiny_tasks import guess, reach, scripted
from torch.testing import assert_close

from repaint_cli.distributions import Categorical, Gaussian
from repaint_cli.errors import DivergedError
from repaint_cli.learn.rollout import Rollout, collect, start
from repaint_cli.learn.seeding import Purpose

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
    return rollout.frames.stores[s].numpy()[rollout.index[:, s]]


def test_the_last_observation_of_an_episode_is_the_true_one():
    # 0 until an episode's last step, then 1; the step after it resets, whatever the action
    obs = np.array([0.0, 0, 1, 0, 0, 0, 1, 0]).reshape(-1, 1, 1)
    env, first = scripted(obs, np.ones((7, 1)), ends=[(1, 0), (5, 0)])
    rollout = collect(env, first, gaussian(), generators(1), n_steps=6)
    assert rollout.valid[:, 0, 0].tolist() == [True, True, False, True, True, True, False][:7]
    followed = seen(rollout)[1:, 0, 0]
    assert_array_equal(followed[rollout.truncations[:, 0, 0]], [1, 1])
    assert followed[rollout.valid[:, 0, 0]].tolist() == [0, 1, 0, 0, 1]


def test_placeholder():
    raise AssertionError
