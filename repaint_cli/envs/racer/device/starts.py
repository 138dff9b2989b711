"""The next episodes of each car, drawn ahead on the CPU by the car's own generator.

They lie in a table on the GPU, where cars begin one after the other without asking the host. The
generators draw what they draw on the CPU, in the same order: the races are the same. **N** cars,
**B** objects, **W** times between lane changes, **K** new episodes.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.device.arrays import Reading, Staging, launch_each, zeros
from repaint_cli.envs.racer.device.launch_cars import put_starts
from repaint_cli.envs.racer.dynamics.directions import Rows
from repaint_cli.envs.racer.dynamics.objects import WAITS, Objects, ObjectSettings
from repaint_cli.envs.racer.dynamics.starts import drawn_fractions, placed
from repaint_cli.envs.racer.track.geometry import Floats
from repaint_cli.envs.racer.track.track import Track

EVERY = 3
"""Steps from one look at how many episodes began to the next."""
AHEAD = EVERY + 1
"""Episodes of a car in the table. A look is acted on a look later, within 2 · `EVERY` steps, in
which a car begins at most `EVERY` episodes, since one lasts a step and beginning it another."""


class Starts:
    """A table of episodes to come, which is filled up while cars drive."""

    def __init__(self, roads: Sequence[Track], n: int, settings: ObjectSettings) -> None:
        """Make a table of N cars on a track in both directions, still empty."""
        self._roads, self._objects = roads, Objects(n, settings) if settings.n else None
        self.places = zeros((AHEAD, n, 4))
        """x, y (m), heading (rad) and lap fraction of each start, on the GPU, (E, N, 4)."""
        self.objects = zeros((AHEAD, n if settings.n else 0, settings.n, 2 + WAITS))
        """Arclength (m), side and times between lane changes (s), (E, N, B, 2 + W)."""
        self.begun = zeros((n,), np.int64)
        """Episodes that each car has begun, (N,), counted by the GPU."""
        self._reading, self._n_objects = Reading(self.begun), settings.n
        self._staging = Staging(n, 6 + settings.n * (2 + WAITS))
        self._on_its_way = False  # whether the last of it may be
        self._drawn, self._steps, self._n = np.zeros(n, np.int64), 0, n

    def begin(
        self, rngs: Sequence[np.random.Generator], fractions: Floats | None,
        reverse: NDArray[np.bool_], stream: Any,
    ) -> None:  # fmt: skip
        """Draw all anew.

        Args:
            rngs: each car's own generator, (N,).
            fractions: of the lap where episodes start, (N,); drawn where absent.
            reverse: which cars drive the other way, (N,).
            stream: on which the table is filled.
        """
        self._rngs, self._fractions, self._reverse = rngs, fractions, reverse
        self._drawn[:], self._steps = 0, 0
        self.begun.copy_to_device(self._drawn, stream)
        self._on_its_way = True
        self._fill(np.zeros(self._n, np.int64), stream)
        self._reading.begin(stream)

    def tick(self, stream: Any) -> None:
        """Count a step, and fill the table up where it is time."""
        self._steps += 1
        if self._steps % EVERY == 0:
            begun = self._reading.result()  # and with it all that was begun before
            self._on_its_way = False
            self._fill(begun, stream)
            self._reading.begin(stream)

    def _fill(self, begun: NDArray[np.int64], stream: Any) -> None:
        """Draw so many episodes that each car has `AHEAD` beyond those that began, (N,)."""
        while len(rows := np.flatnonzero(self._drawn - begun < AHEAD)):
            if self._on_its_way:
                stream.synchronize()
            drawn = self._staging.host[: len(rows)]
            drawn[:, 0], drawn[:, 1] = rows, self._drawn[rows] % AHEAD
            self._draw(rows, drawn)
            self._drawn[rows] += 1
            self._staging.send(len(rows), stream)
            launch_each(
                put_starts, len(rows), stream, len(rows), self._staging.array,
                self._n_objects, self.places, self.objects,
            )  # fmt: skip
            self._on_its_way = True

    def _draw(self, rows: Rows, drawn: Floats) -> None:
        """Draw an episode of these cars (K,) into columns of (K, 6 + B · (2 + W))."""
        fractions = self._fractions
        if fractions is None:
            fractions = drawn_fractions(rows, self._rngs)
        for is_reversed, road in enumerate(self._roads):
            own = self._reverse[rows] == is_reversed
            if own.any():
                drawn[own, 5], drawn[own, 2:5] = placed(
                    road, rows[own], fractions, self._objects, self._rngs
                )
        if self._objects is not None:
            objects = drawn[:, 6:].reshape(len(rows), self._n_objects, 2 + WAITS)
            objects[..., 0] = self._objects.along[rows]
            objects[..., 1] = self._objects.goal_sides[rows]
            objects[..., 2:] = self._objects.waits[rows]
            drawn[:, 6:] = objects.reshape(len(rows), -1)
