"""Models of Stable-Baselines3 to read: untrained ones are enough, with weights of chance."""

import gymnasium
import numpy as np
import torch
from gymnasium.spaces import Box, Discrete
from stable_baselines3 import A2C, PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from repaint_cli.tasks import TaskCard

ALGORITHMS = {"ppo": PPO, "a2c": A2C}
VECTOR = Box(-np.inf, np.inf, (5,), np.float32)
PICTURE = Box(0, 255, (44, 40, 2), np.uint8)
ACTIONS = {"box": Box(-1.0, 1.0, (3,), np.float32), "discrete": Discrete(4)}


class Dream(gymnasium.Env):
    """Nothing follows from anything, for ten steps."""

    def __init__(self, obs, action, render_mode=None):
        self.observation_space, self.action_space = obs, action

    def _look(self):
        shape = self.observation_space.shape
        if self.observation_space.dtype == np.uint8:
            return self.np_random.integers(0, 256, shape, dtype=np.uint8)
        scales = np.geomspace(0.01, 100, *shape)
        return (3 * scales + scales * self.np_random.normal(size=shape)).astype(np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self._look(), {}

    def step(self, action):
        return self._look(), float(np.sum(action)), False, False, {}


def dreams(obs, action):
    """The id of an environment with given spaces."""
    kinds = "".join(c if c.isalnum() else "-" for c in f"{obs.shape}{obs.dtype}{action}")
    name = f"repaint-test/{kinds}-v0"
    if name not in gymnasium.registry:
        make = lambda **settings: Dream(obs, action, **settings)  # noqa: E731
        gymnasium.register(name, make, max_episode_steps=10)
    return name


def task_of(obs, action):
    """A task with given spaces."""
    env = {"simulator": "gymnasium", "id": dreams(obs, action)}
    net = {"kind": "cnn" if len(obs.shape) == 3 else "mlp"}
    data = {"name": "dream", "summary": "Dream.", "env": env, "reward": {"reward": 1.0}, "net": net}
    return TaskCard.parse(data, "dream")


def model(algorithm="ppo", policy="MlpPolicy", obs=VECTOR, action=ACTIONS["box"], **settings):
    """A model with weights large enough for its outputs to matter, and its environment."""
    venv = DummyVecEnv([lambda: gymnasium.make(dreams(obs, action))])
    found = ALGORITHMS[algorithm](policy, venv, seed=3, device="cpu", **settings)
    with torch.no_grad():
        for weight in found.policy.parameters():
            weight += 0.1 * torch.randn_like(weight)
        for head in (found.policy.action_net, found.policy.value_net):
            head.weight *= 3
    return found


def normalised(venv, steps=50, **settings):
    """A VecNormalize that has seen some steps."""
    wrapped = VecNormalize(venv, **settings)
    wrapped.reset()
    for _ in range(steps):
        wrapped.step(np.array([wrapped.action_space.sample()]))
    return wrapped
