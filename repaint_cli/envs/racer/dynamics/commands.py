"""Actions as an environment takes them, and the commands to the car that they stand for.

Commands are steering (rad, left is positive) and speed (m/s) within the car's limits. **N** cars,
**A** listed actions.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Discrete
from numpy.typing import NDArray

from repaint_cli.envs.racer.actions import ActionRanges, Actions
from repaint_cli.envs.racer.arguments import checked_actions, checked_pairs
from repaint_cli.envs.racer.dynamics.car import commands_of
from repaint_cli.envs.racer.track.geometry import Floats

N_ANGLES, N_SPEEDS = 14, 6
"""Of the examples of ranges; even numbers leave out the middle, which is mostly round."""


@dataclass(frozen=True, eq=False)
class ListedCommands:
    """An action is a number: which of a list."""

    examples: Floats
    """The list, (A, 2)."""

    @property
    def space(self) -> Discrete:
        """Of one car's actions."""
        return Discrete(len(self.examples))

    def checked(self, actions: NDArray[Any], n: int) -> NDArray[Any]:
        """Return actions as an array (N,).

        Raises:
            ValueError: the actions are not N integers from 0 to A − 1.
        """
        return checked_actions(actions, n, len(self.examples))

    def of(self, actions: NDArray[Any]) -> Floats:
        """Return the commands, (…, 2), of actions (…)."""
        return np.asarray(self.examples[actions])

    def numbers(self, actions: NDArray[Any]) -> NDArray[Any]:
        """Return which of the list actions (…) are."""
        return actions


@dataclass(frozen=True, eq=False)
class RangedCommands:
    """An action is two numbers from −1 to 1, the ends of the ranges, as in DeepRacer."""

    low: Floats
    """The least steering and speed, (2,)."""
    high: Floats
    """The greatest, (2,)."""

    @property
    def space(self) -> Box:
        """Of one car's actions."""
        return Box(-1.0, 1.0, (2,), np.float32)

    def checked(self, actions: NDArray[Any], n: int) -> NDArray[Any]:
        """Return actions as an array (N, 2).

        Raises:
            ValueError: the actions are not N times two finite numbers.
        """
        return checked_pairs(actions, n)

    def of(self, actions: NDArray[Any]) -> Floats:
        """Return the commands, (…, 2), of actions (…, 2), which are clipped to −1 and 1."""
        share = (np.clip(actions.astype(np.float64), -1, 1) + 1) / 2
        return np.asarray(self.low * (1 - share) + self.high * share)

    def numbers(self, actions: NDArray[Any]) -> NDArray[Any]:
        """Return −1 for each action (…, 2), as DeepRacer's community has it."""
        return np.full(actions.shape[:-1], -1)

    @property
    def examples(self) -> Floats:
        """Commands all over the ranges with both ends, (A, 2): numbers that are hardly round.

        A reward function that knows only round ones would fail in training.
        """
        angles, speeds = ((1 - np.cos(np.linspace(0, np.pi, n))) / 2 for n in (N_ANGLES, N_SPEEDS))
        share = np.stack([part.ravel() for part in np.meshgrid(angles, speeds)], axis=1)
        return np.asarray(self.low * (1 - share) + self.high * share)


Commands = ListedCommands | RangedCommands


def commands_for(actions: Actions) -> Commands:
    """Return the commands that actions, listed or in ranges, stand for."""
    if isinstance(actions, ActionRanges):
        return RangedCommands(*commands_of(actions.corners))
    return ListedCommands(commands_of(actions))
