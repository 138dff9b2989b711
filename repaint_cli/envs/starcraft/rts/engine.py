"""N games side by side: what an environment, a picture and a test use of the mini-RTS."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.starcraft.rts.constants import (
    COMMANDS,
    MEASUREMENTS,
    MINIMAP_LAYERS,
    SCREEN,
    SCREEN_LAYERS,
)
from repaint_cli.envs.starcraft.rts.maps import MapSpec
from repaint_cli.envs.starcraft.rts.rendering import observe_rows
from repaint_cli.envs.starcraft.rts.state import STATS, State
from repaint_cli.envs.starcraft.rts.step import begin_games, step_games
from repaint_cli.envs.starcraft.rts.world import world_of

Rows = NDArray[np.int64]

MEASURED = ("minerals", "food_used", "food_cap", "food_workers", "army_count")
"""The fields of a game that are `MEASUREMENTS`."""


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

    @classmethod
    def empty(cls, n: int) -> "Observation":
        """Return arrays for n games, to be filled."""
        return cls(
            np.empty((n, len(SCREEN_LAYERS), SCREEN, SCREEN), np.uint8),
            np.empty((n, len(MINIMAP_LAYERS), SCREEN, SCREEN), np.uint8),
            np.empty((n, len(MEASUREMENTS)), np.int32),
            np.empty((n, len(COMMANDS)), np.uint8),
        )

    def check_room(self, n: int) -> None:
        """Check that n games fit in.

        Raises:
            ValueError: an array is too small, or of another shape or type.
        """
        wanted = Observation.empty(0)
        for name in self._fields:
            given, like = getattr(self, name), getattr(wanted, name)
            fits = given.shape[1:] == like.shape[1:] and given.dtype == like.dtype
            if len(given) < n or not fits:
                shape = f"{given.shape} of {given.dtype}"
                raise ValueError(f"expected room for {n} games in {name}, found {shape}")


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
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None
        self._threads = threads

    def reset(self, seeds: NDArray[np.int64], rows: Rows | None = None) -> None:
        """Begin games anew.

        Args:
            seeds: of these games, (K,).
            rows: which games, (K,); all by default.

        Raises:
            ValueError: there are not as many seeds as rows, or no such row.
        """
        rows, seeds = self._rows(rows), np.asarray(seeds, np.int64)
        if seeds.shape != rows.shape:
            raise ValueError(f"expected {len(rows)} seeds, found an array {seeds.shape}")
        begin_games(rows, self.state.arrays, self.world, seeds)

    def step(
        self, actions: NDArray[np.int16], active: NDArray[np.bool_] | None = None
    ) -> tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.bool_]]:
        """Let each game go on by eight loops, after an action.

        A game that is over, or not active, stands still, with terms of 0.

        Args:
            actions: command (0-6), x and y (0-83), (N, 3).
            active: which games go on, (N,); all by default.

        Returns:
            the reward terms φ of the step, (N, 8), which games are terminated, which truncated.

        Raises:
            ValueError: an action is none.
        """
        actions = self._checked(actions)
        state = self.state
        goes_on = (state.terminated == 0) & (state.truncated == 0)
        if active is not None:
            goes_on &= active
        rows = np.flatnonzero(goes_on)
        self._share(rows, lambda part, _: step_games(part, state.arrays, self.world, actions))
        phi = np.where(goes_on[:, None], state.phi, np.float32(0.0))
        return phi, state.terminated.astype(np.bool_), state.truncated.astype(np.bool_)

    def observe(self, rows: Rows | None = None, out: Observation | None = None) -> Observation:
        """Return what an agent sees.

        Args:
            rows: of which games, (K,); all by default.
            out: arrays to fill and return; new ones by default.

        Raises:
            ValueError: these arrays are too small, or of another shape or type.
        """
        rows = self._rows(rows)
        observation = out or Observation.empty(len(rows))
        observation.check_room(len(rows))
        self._share(
            rows,
            lambda part, first: observe_rows(
                part, first, self.state.arrays, self.world, *observation
            ),
        )
        return observation

    def stats(self) -> dict[str, NDArray[np.int32]]:
        """Return what happened in each game so far, by name, each (N,) in new arrays."""
        names = (*STATS, "loop", *MEASURED)
        return {name: getattr(self.state, name).astype(np.int32) for name in names}

    def snapshot(self, rows: Rows | None = None) -> NDArray[np.void]:
        """Return copies of games, (K,) of `GAME`, that `restore` takes."""
        return self.state.snapshot(self._rows(rows))

    def restore(self, snapshot: NDArray[np.void], rows: Rows | None = None) -> None:
        """Put games (K,) back as they were when a snapshot was made."""
        self.state.restore(self._rows(rows), snapshot)

    def _rows(self, rows: Rows | None) -> Rows:
        """Return row numbers, all by default.

        Raises:
            ValueError: there is no such row.
        """
        if rows is None:
            return np.arange(self.n)
        rows = np.asarray(rows, np.int64)
        wrong = (rows < 0) | (rows >= self.n)
        if wrong.any():
            raise ValueError(f"expected rows from 0 to {self.n - 1}, found {rows[wrong][0]}")
        return rows

    def _checked(self, actions: NDArray[np.int16]) -> NDArray[np.int16]:
        """Return actions as kernels read them.

        Raises:
            ValueError: there is not one a game, or one has a number out of its range.
        """
        actions = np.asarray(actions)
        if actions.shape != (self.n, 3):
            raise ValueError(f"expected actions ({self.n}, 3), found {actions.shape}")
        limits = (("command", len(COMMANDS)), ("x", SCREEN), ("y", SCREEN))
        for (name, end), numbers in zip(limits, actions.T, strict=True):
            wrong = (numbers < 0) | (numbers >= end)
            if wrong.any():
                raise ValueError(f"expected {name} from 0 to {end - 1}, found {numbers[wrong][0]}")
        return np.ascontiguousarray(actions, np.int16)

    def _share(self, rows: Rows, work: Callable[[Rows, int], None]) -> None:
        """Do work on rows, given the place of their first, with all threads."""
        if self._pool is None or len(rows) < 2:
            work(rows, 0)
            return
        parts = np.array_split(rows, min(self._threads, len(rows)))
        firsts = np.cumsum([0] + [len(part) for part in parts[:-1]])
        for _ in self._pool.map(work, parts, firsts):
            pass

    def close(self) -> None:
        """End the games, of which nothing is left open but the threads."""
        if self._pool is not None:
            self._pool.shutdown()
