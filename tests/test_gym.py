"""Environments of Gymnasium, on EnvPool where that is the same; nothing here learns for long."""

import os
from importlib.util import find_spec

import gymnasium
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from small_tasks import scripted

from repaint_cli.envs.gymnasium.copies import Copies
from repaint_cli.envs.gymnasium.vector import ENVPOOL_IDS, make_gym
from repaint_cli.errors import CardError
from repaint_cli.learn.evaluation import spaces_of
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.card_files import read_task

needs_envpool = pytest.mark.skipif(not find_spec("envpool"), reason="the extra `mujoco` is absent")
BACKENDS = [pytest.param("envpool", marks=needs_envpool), "gymnasium"]
TERMS = ("reward_dist", "reward_ctrl")
ANT_TERMS = ("reward_forward", "reward_survive", "reward_ctrl", "reward_contact")
EPISODE = 50

HALF_CHEETAH = """
summary = "Run forward with little torque."

[env]
simulator = "gymnasium"
id = "HalfCheetah-v5"

[reward]
reward_forward = 1.0
reward_ctrl = 1.0

[ppo]
n_iterations = 1
n_steps = 1001
n_envs = 1
n_epochs = 1
minibatch_size = 1001

[eval]
episodes = 1
"""


def copy_state(obs, env):
    """Bring Gymnasium's Reacher to the state that EnvPool's first observation tells of."""
    angles = np.arctan2(obs[2:4], obs[0:2])
    state = np.concatenate([angles, obs[4:6]]), np.concatenate([obs[6:8], [0, 0]])
    env.unwrapped.set_state(*state)


@needs_envpool
def test_envpools_reacher_is_gymnasiums_on_1000_random_steps():
    assert "Reacher-v5" in ENVPOOL_IDS
    pool, gym = (make_gym("Reacher-v5", 1, {}, backend) for backend in ("envpool", "gymnasium"))
    rng = np.random.default_rng(0)
    obs, _ = pool.reset(seed=[3])
    gym.reset(seed=[3])
    for _ in range(20):
        copy_state(obs[0], gym.envs[0])
        for t in range(EPISODE):
            actions = rng.uniform(-1, 1, (1, 2))
            obs, *ours, info = pool.step(actions)
            expected, *theirs, expected_info = gym.step(actions)
            assert_allclose(obs, expected, rtol=0, atol=1e-6)
            assert_allclose(ours, theirs, rtol=0, atol=1e-6)  # reward, terminated, truncated
            for term in TERMS:
                assert_allclose(info[term], expected_info[term], rtol=0, atol=1e-6)
            assert theirs[2] == (t == EPISODE - 1)
        obs, gym_obs = pool.step(actions)[0], gym.step(actions)[0]  # both begin again here
        assert np.abs([obs[0, 6:8], gym_obs[0, 6:8]]).max() < 0.01


@needs_envpool
def test_envpools_ant_is_gymnasiums_over_40_windows_of_25_random_steps():
    pool, gym = (make_gym("Ant-v5", 1, {}, backend) for backend in ("envpool", "gymnasium"))
    assert "Ant-v5" in ENVPOOL_IDS
    rng = np.random.default_rng(0)
    obs, _ = pool.reset(seed=[3])
    gym.reset(seed=[3])
    ended = False
    for _ in range(40):
        if ended:  # the episode is over; this step begins the next
            obs, *_ = pool.step(np.zeros((1, 8)))
        body = gym.envs[0].unwrapped  # where it is on the plane changes nothing
        body.set_state(np.concatenate([[0, 0], obs[0, :13]]), obs[0, 13:27])
        for t in range(25):
            actions = rng.uniform(-1, 1, (1, 8))
            obs, (reward,), (terminated,), (truncated,), info = pool.step(actions)
            expected, wanted, unhealthy, _, expected_info = body.step(actions[0])
            assert_allclose(obs[0], expected, rtol=0, atol=1e-6)
            assert terminated == unhealthy
            # Speed is measured between places that lag a substep behind, but not after a copy.
            for term in ANT_TERMS if t else ANT_TERMS[1:]:
                assert_allclose(info[term][0], expected_info[term], rtol=0, atol=1e-6)
            if t:
                assert_allclose(reward, wanted, rtol=0, atol=1e-6)
            ended = bool(terminated or truncated)
            if ended:
                break


@pytest.mark.parametrize("backend", BACKENDS)
def test_ants_reward_is_the_sum_of_its_terms(backend):
    env = make_gym("Ant-v5", 3, {}, backend)
    env.reset(seed=[1, 2, 3])
    rng, touched = np.random.default_rng(0), 0.0
    for _ in range(60):
        _, reward, terminated, _, info = env.step(rng.uniform(-1, 1, (3, 8)))
        if terminated.any():
            break
        assert_allclose(sum(info[term] for term in ANT_TERMS), reward, rtol=0, atol=1e-6)
        touched = min(touched, info["reward_contact"].min())
    assert touched < 0  # forces count, unlike in Ant-v4 and before


@pytest.mark.parametrize("backend", BACKENDS)
def test_reachers_reward_is_the_sum_of_its_terms(backend):
    env = make_gym("Reacher-v5", 3, {}, backend)
    env.reset(seed=[1, 2, 3])
    for _ in range(EPISODE):
        actions = np.random.default_rng(0).uniform(-1, 1, (3, 2))
        _, reward, *_, info = env.step(actions)
        assert_allclose(sum(info[term] for term in TERMS), reward, rtol=0, atol=1e-6)
        assert np.all(reward < 0)


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_step_after_the_last_ignores_its_action_and_begins_again(backend):
    def after_reset(action):
        env = make_gym("Reacher-v5", 1, {}, backend)
        env.reset(seed=[7])
        for _ in range(EPISODE):
            last, _, terminated, truncated, _ = env.step(np.full((1, 2), 0.3))
        assert (truncated[0], terminated[0]) == (True, False)
        first, reward, terminated, truncated, _ = env.step(np.full((1, 2), action))
        assert_array_equal([reward, terminated, truncated], 0)
        assert not np.allclose(last[0, 4:6], first[0, 4:6])  # another target
        return first

    assert_array_equal(after_reset(-1.0), after_reset(1.0))


@pytest.mark.parametrize("backend", BACKENDS)
def test_environments_are_seeded_one_by_one(backend):
    env = make_gym("Reacher-v5", 2, {}, backend)
    one = env.reset(seed=[4, 9])[0]
    assert_array_equal(env.reset(seed=[9, 4])[0], one[::-1])
    assert not np.array_equal(one[0], one[1])


@needs_envpool
def test_auto_leaves_unchecked_ids_and_arguments_to_gymnasium():
    assert type(make_gym("Reacher-v5", 1, {})).__name__ == "EnvPoolVector"
    for env_id, kwargs in (("HalfCheetah-v5", {}), ("Reacher-v5", {"reward_dist_weight": 2.0})):
        assert type(make_gym(env_id, 1, kwargs)) is Copies


def test_steps_that_only_reset_earn_nothing_while_others_act():
    env, _ = scripted(np.zeros((4, 2, 1)), [[1, 2], [3, 4], [5, 6]], ends=[(0, 1)])
    outputs = [env.step(np.zeros((2, 1))) for _ in range(3)]
    assert [reward.tolist() for _, reward, *_ in outputs] == [[1, 2], [3, 0], [5, 6]]
    assert outputs[1][-1]["reward_terms"].tolist() == [[3], [0]]


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_term_that_is_not_reported_is_named_with_those_that_are(backend):
    card = read_task("reacher").with_settings(["reward.reward_run=1", f"env.backend={backend}"])
    with pytest.raises(
        CardError, match=r"reports no 'reward_run' .*: reward, reward_ctrl, reward_dist"
    ):
        spaces_of(card.task)


def test_half_cheetah_is_a_task_with_no_code(repaint, home):
    (home / "cheetah.toml").write_text(HALF_CHEETAH)
    said = repaint("transfer", "--method", "scratch", "--task", "cheetah.toml", "--run", "run")
    assert said.code == 0
    assert (home / "run" / "seed-0.safetensors").is_file()


def test_half_cheetahs_reward_is_the_environments_own(home):
    data = {"name": "cheetah", "summary": "", "reward": {"reward_forward": 1, "reward_ctrl": 1}}
    card = TaskCard.parse(
        data | {"env": {"simulator": "gymnasium", "id": "HalfCheetah-v5"}}, "a test"
    )
    ours, theirs = card.make_env(1), gymnasium.make("HalfCheetah-v5")
    ours.reset(seed=[5])
    theirs.reset(seed=5)
    for action in np.random.default_rng(0).uniform(-1, 1, (200, 6)).astype(np.float32):
        assert_allclose(ours.step(action[None])[1][0], theirs.step(action)[1], rtol=1e-12)


@needs_envpool
@pytest.mark.parametrize(("variable", "threads"), [("1", 1), ("3", 3), ("", os.cpu_count())])
def test_envpool_takes_as_many_threads_as_torch(monkeypatch, variable, threads):
    import envpool

    monkeypatch.setenv("OMP_NUM_THREADS", variable)
    asked, make = [], envpool.make

    def spy(*args, num_threads, **kwargs):
        asked.append(num_threads)
        return make(*args, num_threads=1, **kwargs)

    monkeypatch.setattr(envpool, "make", spy)
    env = make_gym("Reacher-v5", 64, {}, "envpool")
    env.reset(seed=0)
    assert asked == [threads]
