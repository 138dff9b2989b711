"""N games side by side: what an environment, a picture and a test use of the mini-RTS."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.starcraft.rts.maps import MapSpec
from repaint_cli.envs.starcraft.rts.state import State
from repaint_cli.envs.starcraft.rts.world import world_of

Rows = NDArray[np.int64]


class Observation(NamedTuple):
    """What an agent sees of K games."""

    screen: NDArray[np.uint8]
    """Layers `SCREEN_LAYERS`, (K, 9, 84, 84), [layer, y, x], y downward."""
    minimap: NDArray[np.uint8]
    """Layers `MINIMAP_LAYERS` of the whole map, (K, 3, 84, 84)."""
    measurements: NDArray[np.int32]
    """`MEASUREMENTS`, raw, (K, 5)."""
    available: NDArray[np.uint8]
    """Whether each of `COMMANDS` is available, 0 or 1, (K, 7)."""


class MiniRTS:
    """N games on one map; each is the same bytes whatever N and the number of threads."""

    def __init__(self, spec: MapSpec, n: int, threads: int = 1) -> None:
        """Make N games; `reset` begins them.

        Args:
            spec: the map and the rules.
            n: N.
            threads: that share the work.
        """
        self.spec = spec
        self.n = n
        self.state = State(n)
        """All arrays of all games, which one may read."""
        self.world = world_of(spec)
        """What does not change in a game, (1,) of `WORLD`."""
        self.threads = threads

    def reset(self, seeds: NDArray[np.int64], rows: Rows | None = None) -> None:
        """Begin games anew.

        Args:
            seeds: of these games, (K,).
            rows: which games, (K,); all by default.
        """
        raise NotImplementedError

    def step(
        self, actions: NDArray[np.int16], active: NDArray[np.bool_] | None = None
    ) -> tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.bool_]]:
        """Let each game go on by eight loops, after an action.

        A game that is over, or not active, stands still, with terms of 0.

        Args:
            actions: command (0-6), x and y (0-83), (N, 3).
            active: which games go on, (N,); all by default.

        Returns:
            the reward terms φ of the step (N, 8), which games are terminated, which truncated.

        Raises:
            ValueError: an action is none.
        """
        raise NotImplementedError

    def observe(self, rows: Rows | None = None, out: Observation | None = None) -> Observation:
        """Return what an agent sees.

        Args:
            rows: of which games, (K,); all by default.
            out: arrays to fill and return.
        """
        raise NotImplementedError

    def stats(self) -> dict[str, NDArray[np.int32]]:
        """Return what happened in each game so far, by name, each (N,) in new arrays."""
        raise NotImplementedError

    def snapshot(self, rows: Rows | None = None) -> NDArray[np.void]:
        """Return copies of games, (K,), that `restore` takes."""
        raise NotImplementedError

    def restore(self, snapshot: NDArray[np.void], rows: Rows | None = None) -> None:
        """Put games back as they were when a snapshot was made, (K,)."""
        raise NotImplementedError
