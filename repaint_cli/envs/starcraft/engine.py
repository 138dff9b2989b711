"""What plays the mini-games: the interface that our simulator and the game itself have in common.

**N** games · **K** of them · **F** reward terms, `constants.TERMS`.
"""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.starcraft.rts.engine import Observation

Flags = NDArray[np.bool_]
Rows = NDArray[np.intp]


class Engine(Protocol):
    """Plays N games of one map."""

    def reset(self, seeds: NDArray[np.int64], rows: Rows | None = None, /) -> None:
        """Begin new episodes.

        Args:
            seeds: of the K episodes, (K,).
            rows: which games begin, (K,); None is all of them.
        """

    def step(
        self, actions: NDArray[np.int16], playing: Flags | None = None, /
    ) -> tuple[NDArray[np.float32], Flags, Flags]:
        """Give every game a command and let it go on for `constants.LOOPS_PER_STEP`.

        Args:
            actions: command, column and row of a pixel, (N, 3).
            playing: which games go on, (N,); None is all of them.

        Returns:
            terms counted in this step (N, F), terminations (N,), truncations (N,); nothing of games
            that do not go on.
        """

    def observe(self, rows: Rows | None = None, out: Observation | None = None, /) -> Observation:
        """Return what is seen.

        Args:
            rows: which games are looked at, (K,); None is all of them.
            out: arrays to fill and return; None is new ones.
        """

    def stats(self) -> Mapping[str, NDArray[Any]]:
        """Return numbers of the episodes so far by name, (N,) each: `minerals_mined`."""

    def close(self) -> None:
        """End the games."""
