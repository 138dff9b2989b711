"""One suite for every shipped card and its environment: a new card is tested without a new test."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from repaint_cli.envs.racer.simulator import RacerSimulator
from repaint_cli.files.paths import shipped_tasks
from repaint_cli.tasks.card_files import read_task

N = 2
ALWAYS_ALIVE = {"Ant-v5": 27}
"""Numbers before those that need not move: forces on parts of the body that touch nothing."""


@pytest.fixture(params=sorted(shipped_tasks()))
def card(request):
    return read_task(request.param)


def parts(obs):
    """The arrays of an observation, one or several."""
    return list(obs.values()) if isinstance(obs, dict) else [obs]


def played(card, seeds, n_steps):
    """What an environment tells over some random steps, from the first observation on."""
    env = card.make_env(N)
    obs, _ = env.reset(seed=seeds)
    env.action_space.seed(0)
    outputs = [(obs, np.zeros(N), np.zeros(N, bool), np.zeros(N, bool), {})]
    outputs += [env.step(env.action_space.sample()) for _ in range(n_steps)]
    env.close()
    return env, outputs


def test_the_reward_is_the_weighted_sum_of_the_named_terms(card):
    env, outputs = played(card, [1, 2], 20)
    for _, rewards, *_, info in outputs[1:]:
        weighed = sum(w * info["reward_terms"][:, f] for f, w in enumerate(card.reward.values()))
        assert_allclose(rewards, weighed, rtol=1e-12)
        for f, name in enumerate(card.reward):
            assert_array_equal(info["reward_terms"][:, f], info[name])
    assert env.names == tuple(card.reward)


def test_the_same_seed_gives_the_same_trajectory_and_another_seed_another(card):
    def trajectory(seeds):
        _, outputs = played(card, seeds, 60)  # beyond an episode's end
        steps = [[*parts(obs), *rest] for obs, *rest, _ in outputs]
        return [np.stack(column) for column in zip(*steps, strict=True)]

    one, again, other = (trajectory(seeds) for seeds in ([3, 4], [3, 4], [13, 14]))
    for column, repeated in zip(one, again, strict=True):
        assert_array_equal(column, repeated)
    assert not np.array_equal(one[0], other[0])


def test_observations_share_no_memory(card):
    _, outputs = played(card, [1, 2], 3)
    for (before, *_), (after, *_) in pairwise(outputs):
        for one, other in zip(parts(before), parts(after), strict=True):
            assert not np.shares_memory(one, other)


def test_no_sensor_is_dead(card):
    _, outputs = played(card, [1, 2], 300)
    for part in zip(*(parts(obs) for obs, *_ in outputs), strict=True):
        seen = np.stack(part)  # (T, N, *O)
        if seen.ndim > 3:
            assert np.all(seen.std(axis=(2, 3, 4)) > 0)  # no image is of one grey
            assert np.any(seen[0] != seen[20])
        elif len(parts(outputs[0][0])) == 1:
            alive = seen.std(axis=(0, 1)) > 0
            assert np.all(alive[: ALWAYS_ALIVE.get(card.env.id)])
            assert np.any(alive[ALWAYS_ALIVE.get(card.env.id, 0) :])
        else:
            assert seen.std() > 0  # a lidar, which need not meet something with every beam


def test_observations_and_actions_are_in_their_spaces(card):
    env, outputs = played(card, [1, 2], 60)
    assert env.num_envs == env.action_space.shape[0] == N
    for obs, *_ in outputs:
        assert env.observation_space.contains(obs)


def test_a_time_limit_truncates_and_does_not_terminate(card):
    limit = card.env.longest_episode()
    if isinstance(card.env, RacerSimulator):
        limit = 20
        card = card.with_settings(["env.max_steps=20"])
        env = card.make_env(N)
        env.reset(seed=[1, 2], options={"lap_fraction": [0.0, 0.5]})
        drive = np.full(N, 2)  # straight on, slowly: neither stuck nor off the track nor into a bot
    else:
        env = card.make_env(N)
        obs, _ = env.reset(seed=[1, 2])
        drive = np.zeros((N, *env.single_action_space.shape), int)
    ends = []
    for _ in range(limit):
        if card.env.simulator == "gymnasium" and card.env.id == "CartPole-v1":
            drive = np.int64(obs @ [0.05, 0.1, 1.0, 0.5] > 0)  # push under where the pole falls
        obs, _, *over, _ = env.step(drive)
        ends.append(over)
    assert not np.any(ends[:-1])
    assert_array_equal(ends[-1], [[False] * N, [True] * N])
