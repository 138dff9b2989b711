"""Paths of episodes: where a car or a fingertip went, and how a simulator draws it.

**S** seeds · **T** steps · **E** episodes a seed · **O** observation.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np

from repaint_cli.envs.episodes import EpisodePaths, Episodes


class PathFormat(ABC):
    """Finds the paths of a simulator's episodes, and draws them."""

    colours: ClassVar[Mapping[str, str]] = {}
    """What may colour paths, by name, with its unit; the first is the default."""

    @property
    def records(self) -> tuple[str, ...]:
        """The records that `draw` shows: a run keeps them of its evaluations."""
        return ()

    @abstractmethod
    def paths_of(
        self,
        valid: np.ndarray,
        records: Mapping[str, np.ndarray],
        observations: Callable[[], np.ndarray],
    ) -> EpisodePaths:
        """Return the paths of evaluated episodes.

        Args:
            valid: which steps count, (T, S, E).
            records: what was recorded, (T, S, E, …), nan after the end.
            observations: returns all observations, (S, T+1, E, O), where they are vectors.
        """

    @abstractmethod
    def draw(
        self, panels: Sequence[tuple[str, Episodes]], path: Path, title: str, colour: str
    ) -> None:
        """Draw the first seed's paths, a panel per evaluation.

        Args:
            panels: a label and an evaluation each, in reading order.
            path: of the PNG.
            title: over the whole figure.
            colour: what colours the paths, a name in `colours`; "" is the default.

        Raises:
            StoreError: the file cannot be written.
        """
