"""Tasks small enough to be read at a glance, for tests of the learning core."""

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Discrete
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from repaint_cli.envs.terms import RewardTerms
from repaint_cli.tasks import TaskCard


class Reach(gymnasium.Env):
    """A point on a line goes to a target at −1 or +1 in steps of at most 0.3."""

    observation_space = Box(-np.inf, np.inf, (2,), np.float64)
    action_space = Box(-1.0, 1.0, (1,), np.float64)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.x, self.target = 0.0, self.np_random.choice([-1.0, 1.0])
        return np.array([self.x, self.target]), {}

    def step(self, action):
        self.x += 0.3 * float(action[0])
        terms = {"distance": -abs(self.x - self.target), "effort": -(float(action[0]) ** 2)}
        return np.array([self.x, self.target]), sum(terms.values()), False, False, terms


class Guess(gymnasium.Env):
    """Name the place of a light among three; every step may be the last, by chance.

    The light is a number in a vector, or a bright stripe in a 24 × 24 image.
    """

    action_space = Discrete(3)

    def __init__(self, image=False):
        self.image = image
        self.observation_space = (
            Box(0, 255, (24, 24, 1), np.uint8) if image else Box(0.0, 1.0, (3,), np.float64)
        )

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self._look(), {}

    def step(self, action):
        hit = float(action == self.place)
        ended = bool(self.np_random.random() < 0.1)
        return self._look(), hit, ended, False, {"hit": hit, "miss": hit - 1}

    def _look(self):
        self.place = int(self.np_random.integers(3))
        if not self.image:
            return np.eye(3)[self.place]
        picture = self.np_random.integers(0, 60, (24, 24, 1)).astype(np.uint8)
        picture[:, 8 * self.place : 8 * self.place + 8] += 180
        return picture


ENVS = {"Reach": (Reach, 8), "Guess": (Guess, 30)}
for name, (env, max_steps) in ENVS.items():
    gymnasium.register(
        f"repaint-tests/{name}-v0", env, max_episode_steps=max_steps, disable_env_checker=True
    )


def card(name, reward, **sections):
    """A task card of one of the environments above."""
    env = {"simulator": "gymnasium", "id": f"repaint-tests/{name}-v0"} | sections.pop("env", {})
    data = {"name": name.lower(), "summary": "A tiny task.", "env": env, "reward": reward}
    return TaskCard.parse(data | sections, "a test")


def reach(distance=1.0, effort=0.0, *, select=None, **ppo):
    """Reach, counted in steps: continuous actions, time limits."""
    ppo = {"n_iterations": 2, "n_steps": 72, "n_envs": 4, "n_epochs": 2, "minibatch_size": 32} | ppo
    weights = {"distance": distance, "effort": effort}
    return card("Reach", weights, net={"hidden": (16, 16)}, ppo=ppo, select=select or {})


def guess(*, image=False, select=None, **ppo):
    """Guess, counted in episodes of random lengths: discrete actions, terminations."""
    ppo = {"n_iterations": 2, "n_episodes": 4, "n_epochs": 2, "minibatch_size": 16} | ppo
    net = {"hidden": (16, 16)}
    if image:
        net = {"kind": "cnn", "conv": ((4, 4, 2), (8, 3, 1)), "dense": 16}
    kwargs = {"env": {"kwargs": {"image": image}}, "select": select or {}}
    return card("Guess", {"hit": 1.0}, net=net, ppo=ppo, **kwargs)


class Script(VectorEnv):
    """Plays back what it was given, and notes what it was told."""

    def __init__(self, obs, rewards, ends=(), terminated=False, discrete=None):
        """obs (T+1, N, *O), rewards (T, N), ends: (t, n) of the steps that end an episode."""
        self.obs, self.rewards = np.asarray(obs), np.asarray(rewards, float)
        self.num_envs = self.rewards.shape[1]
        bounds = (0, 255) if self.obs.dtype == np.uint8 else (-np.inf, np.inf)
        self.single_observation_space = Box(*bounds, self.obs.shape[2:], self.obs.dtype)
        self.single_action_space = Discrete(discrete) if discrete else Box(-1.0, 1.0, (1,))
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}
        self.ends = np.zeros(self.rewards.shape, bool)
        for t, n in ends:
            self.ends[t, n] = True
        self.terminated, self.told = terminated, []

    def reset(self, *, seed=None, options=None):
        return self.obs[0], {}

    def step(self, actions):
        t = len(self.told)
        self.told.append(np.array(actions))
        ends, never = self.ends[t], np.zeros(self.num_envs, bool)
        terminations, truncations = (ends, never) if self.terminated else (never, ends)
        return self.obs[t + 1], self.rewards[t], terminations, truncations, {"pay": self.rewards[t]}


def scripted(*args, **kwargs):
    """A script as the rollout sees it; returns it with its first observations."""
    env = RewardTerms(Script(*args, **kwargs), {"pay": 1.0})
    return env, env.reset()[0]
