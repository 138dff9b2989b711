"""Rollouts that cut episodes: bootstrapped at the cut, and carried on in the next iteration."""

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.spaces import Box, Dict, Discrete
from numpy.testing import assert_allclose, assert_array_equal
from small_learners import learner_of, training
from small_tasks import card, guess, reach, scripted

from repaint_cli.learn.rollout.collect import collect
from repaint_cli.learn.rollout.gae import to_samples
from repaint_cli.learn.rollout.stream import Stream
from repaint_cli.learn.seeding import Purpose
from repaint_cli.policies.distributions import Categorical, Gaussian


def sure(obs, counts):
    """A policy that names the light, whatever the noise."""
    return Categorical((100.0 * torch.as_tensor(obs)).log_softmax(-1))


def constant(value):
    def policy(obs, counts):
        means = torch.full((*obs.shape[:2], 1), value)
        return Gaussian(means, torch.full((len(obs), 1, 1), -30.0))

    return policy


def generators(n):
    return [np.random.default_rng(s) for s in range(n)]


def continued(task=None, seeds=(0, 1), n_envs=3):
    return Stream.begin(task or guess_steps(), list(seeds), n_envs, Purpose.TRAIN, 1, 0)


def guess_steps(**ppo):
    """Guess, counted in steps that cut its episodes of up to 30."""
    settings = {"n_episodes": None, "n_steps": 24, "n_envs": 3} | ppo
    return guess(**settings)


def test_steps_that_are_shorter_than_an_episode_continue_it():
    # an episode of Reach has 8 steps, and one more begins the next
    assert not reach(n_steps=36, n_envs=4).continues_episodes
    assert reach(n_steps=35, n_envs=4).continues_episodes
    assert reach(n_steps=72, n_envs=4, continue_episodes=True).continues_episodes
    assert not reach(n_steps=4, n_envs=4, continue_episodes=False).continues_episodes
    assert not reach(n_steps=4, n_envs=1, whole_episodes=True).continues_episodes
    assert not guess(n_episodes=4, continue_episodes=True).continues_episodes


def test_two_rollouts_in_a_row_are_one_of_twice_the_length():
    parts, whole = continued(), continued()
    first, second = (parts.collect(sure, generators(2), 20) for _ in range(2))
    both = whole.collect(sure, generators(2), 40)
    for name in ("actions", "rewards", "valid", "terminations", "truncations"):
        pair = np.concatenate([getattr(first, name), getattr(second, name)])
        assert_array_equal(pair, getattr(both, name), name)
    pairs = zip(first.episodes(), second.episodes(), strict=True)
    columns = [np.concatenate(pair) for pair in pairs]
    assert sorted(zip(*columns, strict=True)) == sorted(zip(*both.episodes(), strict=True))
    assert second.episodes()[2].max() > 8  # one that began in the first
    assert_array_equal(parts.lengths, whole.lengths)
    assert_array_equal(parts.episodes, whole.episodes)
    assert parts.ended.any() == whole.ended.any()


def test_all_seeds_stop_together_and_only_the_steps_that_begin_an_episode_do_not_count():
    rollout = continued().collect(sure, generators(2), 40)
    assert rollout.valid.shape == (40, 2, 3)
    ended = rollout.terminations | rollout.truncations
    assert_array_equal(rollout.valid[1:], ~ended[:-1])
    assert rollout.valid[0].all()


def test_a_cut_is_bootstrapped_and_an_end_is_not():
    # three steps of reward 1; V = 10 everywhere, λ = 0: Â = r + γ·V(s′) − V(s)
    env, first = scripted(np.zeros((4, 2, 1)), np.ones((3, 2)), ends=[(2, 1)], terminated=True)
    rollout = collect(env, first, constant(0.0), generators(1), each_steps=3)
    ppo = reach(gamma=0.5, gae_lambda=0.0).ppo
    samples = to_samples(rollout, lambda obs, counts: torch.full(obs.shape[:2], 10.0), ppo)
    assert_allclose(samples.advantages.reshape(3, 2), [[-4, -4], [-4, -4], [-4, -9]])


def test_a_seed_among_others_goes_on_as_it_does_alone():
    task, policy = guess_steps(), sure
    pair, alone = continued(task, (3, 4)), continued(task, (4,))
    for _ in range(3):
        together = pair.collect(policy, generators(2), 13)
        one = alone.collect(policy, generators(2)[1:], 13)
        assert_array_equal(together.rewards[:, 1], one.rewards[:, 0])
        assert_array_equal(together.valid[:, 1], one.valid[:, 0])


class Pictures(gymnasium.Env):
    """Two sensors; what comes next is drawn by chance, and an episode ends by chance."""

    observation_space = Dict(
        camera=Box(0, 255, (8, 8, 1), np.uint8), lidar=Box(0.0, 1.0, (3,), np.float32)
    )
    action_space = Discrete(3)
    steps = 0

    def __init__(self, forgets=False):
        self.forgets = forgets

    def reset(self, *, seed=None, options=None):
        super().reset(seed=None if self.forgets else seed)
        return self._look(), {}

    def step(self, action):
        end = bool(self.np_random.random() < 0.1)
        return self._look(), float(action), end, False, {"hit": float(action)}

    def _look(self):
        camera = self.np_random.integers(0, 255, (8, 8, 1)).astype(np.uint8)
        return {"camera": camera, "lidar": self.np_random.random(3, np.float32)}


gymnasium.register("repaint-tests/Pictures-v0", Pictures, max_episode_steps=40)


def pictures(forgets=False):
    net = {"kind": "cnn", "conv": ((4, 4, 2),), "dense": 16}
    sections = {"net": net, "ppo": {"n_steps": 24, "n_envs": 3}}
    return card("Pictures", {"hit": 1.0}, env={"kwargs": {"forgets": forgets}}, **sections)


def uniform(obs, counts):
    lidar = obs["lidar"] if isinstance(obs, dict) else obs
    return Categorical(torch.zeros(*lidar.shape[:2], 3).log_softmax(-1))


def restored(stream, task):
    """The stream after a stop: through the tensors of a checkpoint, and played again."""
    other = Stream.of_state({name: tensor.clone() for name, tensor in stream.state().items()})
    return other, other.bring_back(task)


@pytest.mark.parametrize("name", ["guess", "reach", "pictures"])
@pytest.mark.parametrize("n_steps", [1, 8, 9, 33])
def test_episodes_are_brought_back_to_the_step_where_they_were(name, n_steps):
    task, policy = {
        "guess": (guess_steps(), sure),
        "reach": (reach(n_steps=24, n_envs=3), constant(0.7)),
        "pictures": (pictures(), uniform),
    }[name]
    stream = continued(task)
    for _ in range(2):
        stream.collect(policy, generators(2), n_steps)
        other, whole = restored(stream, task)
        assert whole
    rollouts = [each.collect(policy, generators(2), 50) for each in (stream, other)]
    for column in ("actions", "rewards", "valid", "terminations", "truncations"):
        assert_array_equal(*(getattr(rollout, column) for rollout in rollouts), column)
    assert_array_equal(*(np.array(rollout.episodes()) for rollout in rollouts))
    after = other.state()
    for name, tensor in stream.state().items():
        assert torch.equal(tensor, after[name]), name


def test_an_environment_that_goes_another_way_is_not_brought_back():
    task = pictures(forgets=True)
    stream = continued(task)
    stream.collect(uniform, generators(2), 8)
    assert not restored(stream, task)[1]


@pytest.mark.parametrize(
    ("task", "why"),
    [
        (pictures(forgets=True), "did not come back to where it was"),
        (guess_steps(), None),
    ],
)  # fmt: skip
def test_what_begins_afresh_is_said(task, why):
    learner = learner_of(task, [0, 1])
    learner.collect(task, 1, uniform)
    learner.iteration = 1
    learner.streams = {
        name: Stream.of_state(stream.state()) for name, stream in learner.streams.items()
    }
    notices = learner.bring_streams_back(task)
    assert bool(learner.streams) == (why is None)
    assert [why in notice for notice in notices] == ([] if why is None else [True])
    learner.collect(task, 2, uniform)


def test_environments_without_replay_begin_afresh_and_say_so(monkeypatch):
    task = guess_steps()
    monkeypatch.setattr(type(task.env), "make_replayable", lambda self, n_envs: None)
    learner = learner_of(task, [0])
    learner.collect(task, 1)
    learner.iteration, learner.streams = 1, {}  # a checkpoint holds none of them
    (notice,) = learner.bring_streams_back(task)
    assert "cannot be set back into an episode, so its episodes begin afresh" in notice


def test_training_learns_from_cut_episodes():
    task = guess_steps(n_iterations=12, n_epochs=4, learning_rate=0.01)
    learner = learner_of(task, [0, 1])
    stats = list(training(task, learner))
    assert (learner.env_steps < 12 * 24).all()
    assert (learner.env_steps > 12 * 20).all()
    returns = np.array([one.metrics["episode_return"] for one in stats])
    lengths = np.array([one.metrics["episode_length"] for one in stats])
    assert np.nanmax(lengths) > 8  # longer than an environment's share of a rollout
    hits = returns / lengths
    assert np.nanmean(hits[-3:]) > 0.8 > 0.5 > np.nanmean(hits[:2])
