"""An environment played with random actions: its reward and the numbers of its infos, by step.

**B** steps, of all episodes one after the other.
"""

from dataclasses import dataclass
from time import monotonic
from typing import Any

import numpy as np

from repaint_cli.envs.reward_terms import OWN_REWARD, RewardTerms, numbers_in
from repaint_cli.envs.simulator import Simulator

N_ENVS = 4
MOST_STEPS = 4000
"""Of all environments together."""
MOST_SECONDS = 10.0


@dataclass(frozen=True)
class Played:
    """Steps of random actions."""

    rewards: np.ndarray
    """The environment's own, (B,)."""
    numbers: dict[str, np.ndarray]
    """What infos report by name, (B,); nan in steps that leave it out."""
    returns: list[float]
    """Of the episodes that ended."""


def play(simulator: Simulator, seed: int = 0) -> Played:
    """Play some episodes, or parts of them, with random actions.

    Raises:
        CardError: the environment cannot be made, or fails.
    """
    env = RewardTerms(simulator.make(N_ENVS, False, None), {OWN_REWARD: 1.0})
    try:
        return _play(env, seed)
    finally:
        env.close()


def _play(env: RewardTerms, seed: int) -> Played:
    rewards, steps, returns = list[np.ndarray](), list[dict[str, np.ndarray]](), list[float]()
    env.reset(seed=[seed + n for n in range(env.num_envs)])
    env.action_space.seed(seed)
    acting, sums = np.ones(env.num_envs, bool), np.zeros(env.num_envs)
    began = monotonic()
    while len(rewards) * env.num_envs < MOST_STEPS and monotonic() < began + MOST_SECONDS:
        _, _, terminated, truncated, info = env.step(env.action_space.sample())
        own, ended = info[OWN_REWARD], terminated | truncated
        rewards.append(own[acting])
        steps.append({name: _reported(info, name)[acting] for name in numbers_in(info)})
        sums += np.where(acting, own, 0)
        returns += sums[ended].tolist()
        sums[ended] = 0
        acting = ~ended  # the next step of the others only resets them
    names = sorted({name for step in steps for name in step} - {OWN_REWARD})
    lengths = [len(own) for own in rewards]
    numbers = {
        name: np.concatenate(
            [step.get(name, np.full(n, np.nan)) for step, n in zip(steps, lengths, strict=True)]
        )
        for name in names
    }
    return Played(np.concatenate(rewards), numbers, returns)


def _reported(info: dict[str, Any], name: str) -> np.ndarray:
    """Return a number of each environment, (N,), nan where it leaves it out."""
    values = np.asarray(info[name], np.float64)
    mask = True if name == OWN_REWARD else info.get(f"_{name}", True)
    return np.where(mask, values, np.nan)
