"""A user's own reward functions, `def reward_function(params)`, in a simulator that knows `params`.

**B** states · **F** reward terms.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from repaint_cli.envs.simulator import Environments


Functions = list[Callable[[dict[str, Any], int], float]]
"""A user's function for each copy of an environment, with variables of its own."""


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
