"""Copies of one Gymnasium environment that step together, one after the other."""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from functools import reduce
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from repaint_cli.envs.numbers import describe, number_of
from repaint_cli.errors import CardError


class Copies(SyncVectorEnv):
    """N copies of an environment; each number of their infos is an array (N,) float64.

    Gymnasium's own arrays take their type from the first copy: an integer there would cut off the
    fractions of the others, and a list of another length would end the training. Here whatever is
    no number is an array (N,) of objects. An entry `_name` says which copies reported it.
    """

    def __init__(
        self, env_id: str, n_envs: int, kwargs: Mapping[str, Any], wrappers: Sequence[Any] = ()
    ) -> None:
        def make() -> gymnasium.Env[Any, Any]:
            own = deepcopy(dict(kwargs))  # an environment may change a list
            env: gymnasium.Env[Any, Any] = _OneReward(gymnasium.make(env_id, **own))
            return reduce(lambda inner, wrapper: wrapper(inner), wrappers, env)

        super().__init__([make] * n_envs, autoreset_mode=AutoresetMode.NEXT_STEP)

    def _add_info(
        self, vector_infos: dict[str, Any], env_info: dict[str, Any], env_num: int
    ) -> dict[str, Any]:
        """Add what copy `env_num` reported."""
        for key, value in env_info.items():
            number = number_of(value)
            array = vector_infos.get(key)
            if array is None:
                array = np.zeros(self.num_envs, np.float64 if number is not None else object)
                vector_infos[key], vector_infos[f"_{key}"] = array, np.zeros(self.num_envs, bool)
            elif number is None and array.dtype != object:
                array = vector_infos[key] = array.astype(object)
            array[env_num] = value if number is None else number
            vector_infos[f"_{key}"][env_num] = True
        return vector_infos


class _OneReward(gymnasium.Wrapper[Any, Any, Any, Any]):
    """An environment whose reward is a float, also where it gives an array of one number."""

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Advance by one step.

        Raises:
            CardError: the reward is no number.
        """
        obs, reward, terminated, truncated, info = self.env.step(action)
        number = number_of(reward)
        if number is None:
            raise CardError(
                f"expected a number as the environment's reward, found {describe(reward)}"
            )
        return obs, number, terminated, truncated, info
