"""What plays the mini-games: the interface that our simulator and the game itself have in common.

**N** games · **K** of them · **F** reward terms, `names.TERMS`.
"""

from collections.abc import Mapping
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Flags = NDArray[np.bool_]
Rows = NDArray[np.intp]

SCREEN_LAYERS = (
    "height_map", "visibility_map", "player_relative", "unit_type", "selected",
    "unit_hit_points", "unit_hit_points_ratio", "unit_density", "unit_density_aa",
)  # fmt: skip
"""Of the screen, in order."""

MINIMAP_LAYERS = ("visibility_map", "player_relative", "selected")
"""Of the minimap, in order."""

UNIT_TYPES = (
    "nothing", "command centre", "supply depot", "barracks", "SCV", "marine", "zergling", "minerals"
)  # fmt: skip
"""What the values of the layer `unit_type` mean."""


class Observation(NamedTuple):
    """What is seen of N games."""

    screen: NDArray[np.uint8]
    """(N, 9, 84, 84): layer, row, column; row 0 is the north."""
    minimap: NDArray[np.uint8]
    """(N, 3, 84, 84), likewise."""
    measurements: NDArray[np.int32]
    """(N, 5), as `names.MEASUREMENTS` says."""
    available: NDArray[np.uint8]
    """(N, 7): 1 where a command can be carried out."""


class Engine(Protocol):
    """Plays N games of one map."""

    def reset(self, seeds: NDArray[np.uint64], rows: Rows | None = None) -> None:
        """Begin new episodes.

        Args:
            seeds: of the K episodes, (K,).
            rows: which games begin, (K,); None is all of them.
        """

    def step(
        self, actions: NDArray[np.int16], playing: Flags | None = None
    ) -> tuple[NDArray[np.float32], Flags, Flags]:
        """Give every game a command and let it go on for `names.LOOPS_PER_STEP`.

        Args:
            actions: command, column and row of a pixel, (N, 3).
            playing: which games go on, (N,); None is all of them.

        Returns:
            terms counted in this step (N, F), terminations (N,), truncations (N,); nothing of games
            that do not go on.
        """

    def observe(self, rows: Rows | None = None, seen: Observation | None = None) -> Observation:
        """Return what is seen.

        Args:
            rows: which games are looked at, (K,); None is all of them.
            seen: where their rows are written; None is new arrays, with zeros for other games.
        """

    def stats(self) -> Mapping[str, NDArray[np.int64]]:
        """Return numbers of the episodes so far, (N,) each: `loops` and `minerals_mined`."""

    def close(self) -> None:
        """End the games."""
