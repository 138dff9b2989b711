"""DeepRacer's reward functions in our racing simulator."""

from typing import TYPE_CHECKING

import numpy as np

from repaint_cli.envs.racer.simulator import RacerSimulator
from repaint_cli.envs.reward_functions import FunctionCheck, Functions, RewardFunctions

if TYPE_CHECKING:
    from repaint_cli.envs.simulator import Environments


class RacerRewardFunctions(RewardFunctions):
    """Reward functions of what a car's `params` say."""

    def __init__(self, env: RacerSimulator) -> None:
        self._env = env

    def apply(
        self, env: "Environments", name: str, source: str, functions: Functions | None = None
    ) -> "Environments":
        """Return the cars with a user's reward function; see `RewardFunctions.apply`."""
        from repaint_cli.envs.racer.deepracer.reward_file import RewardFile

        return RewardFile(env, name, source, functions)

    def sample(self, name: str, source: str) -> tuple[np.ndarray, np.ndarray, list[str]]:
        """Return φ and rewards of what 64 wandering cars meet; see `RewardFunctions.sample`."""
        from repaint_cli.envs.racer.wander import sample_rewards

        return sample_rewards(self._env, name, source)

    def check(self, name: str, source: str) -> FunctionCheck:
        """Drive 64 cars in all ways to the end of a lap; see `RewardFunctions.check`."""
        from repaint_cli.envs.racer.deepracer.reward_check import check_function

        return check_function(self._env, name, source)
