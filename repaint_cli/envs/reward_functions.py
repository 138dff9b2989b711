"""A user's own reward functions, `def reward_function(params)`, in a simulator that knows `params`.

**B** states · **F** reward terms.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from repaint_cli.errors import RewardFailed

if TYPE_CHECKING:
    from repaint_cli.envs.simulator import Environments


class UserFunction(ABC):
    """A user's function with variables of its own."""

    @abstractmethod
    def __call__(self, params: dict[str, Any], row: int) -> float:
        """Return what it pays environment `row` for a step."""

    def remembers(self) -> list[str]:
        """Return the names of its variables that have changed since it was made."""
        return []


Functions = list[UserFunction]
"""One for each copy of an environment."""


@dataclass
class FunctionCheck:
    """What came of trying a user's function in states of all kinds."""

    errors: list[RewardFailed] = field(default_factory=list)
    """How it fails, each way once."""
    warnings: list[str] = field(default_factory=list)
    """What training stumbles over."""
    notes: list[str] = field(default_factory=list)
    """What it pays, and what it takes, for people."""


class RewardFunctions(ABC):
    """Lets a user's function pay for steps, and tells what it pays where."""

    @abstractmethod
    def apply(
        self, env: "Environments", name: str, source: str, functions: Functions | None = None
    ) -> "Environments":
        """Return the environments with the one term "function", which the function pays.

        Args:
            env: what `Simulator.make` returned.
            name: the function's file, for messages.
            source: its text.
            functions: those of copies made before, whose variables go on; those of further copies
                are added.

        Raises:
            CardError: the text does not run or has no such function.
        """

    @abstractmethod
    def sample(self, name: str, source: str) -> tuple[np.ndarray, np.ndarray, list[str]]:
        """Return φ (B, F) in B states, what the function pays there (B,), and φ's names.

        Raises:
            CardError: the function failed.
        """

    def check(self, name: str, source: str) -> FunctionCheck:
        """Try the function in states of all kinds that training may meet; a simulator may do more.

        Raises:
            CardError: the text does not run or has no such function.
        """
        return FunctionCheck()
