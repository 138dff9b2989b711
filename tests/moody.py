"""An environment of a user's that has bad days, found as `moody:Moody-v0`."""

import gymnasium
import numpy as np
from gymnasium.spaces import Box


class Moody(gymnasium.Env):
    """A point on a line; what goes wrong, and after how many steps of an episode, is told."""

    observation_space = Box(-np.inf, np.inf, (2,), np.float64)
    action_space = Box(-1.0, 1.0, (1,), np.float64)

    def __init__(self, mood="none", after=3, scale=1.0):
        self.mood, self.after, self.scale = mood, after, scale

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        if self.mood == "fails when reset":
            raise RuntimeError("no simulator today\nand more")
        self.x, self.steps = self.np_random.uniform(-1, 1), 0
        return self._look(), {}

    def step(self, action):
        self.steps += 1
        self.x += 0.3 * float(action[0])
        pay, now = -self.scale * abs(self.x), self.steps > self.after
        if self.mood == "fails" and now:
            raise ValueError("the arm fell off")
        if self.mood == "hangs" and now:
            while True:
                pass
        if self.mood == "nan reward" and now:
            pay = np.nan
        if self.mood == "infinite reward" and now:
            pay = np.inf
        return self._look(now), pay, self.mood == "ends at once", False, {"pay": pay}

    def _look(self, now=False):
        return np.array([self.x, np.nan if self.mood == "nan observation" and now else self.x])


gymnasium.register("Moody-v0", Moody, max_episode_steps=6, disable_env_checker=True)
gymnasium.register("Endless-v0", Moody, disable_env_checker=True)

CARD = """
summary = "A bad day."
[env]
simulator = "gymnasium"
id = "moody:{name}-v0"
kwargs = {{ mood = "{mood}", after = {after}, scale = {scale} }}
[reward]
pay = 1.0
[ppo]
n_iterations = 3
n_steps = 28
n_envs = 2
n_epochs = 2
[eval]
episodes = 2
"""


def card(mood="none", *, name="Moody", after=3, scale=1.0):
    return CARD.format(mood=mood, name=name, after=after, scale=float(scale))
