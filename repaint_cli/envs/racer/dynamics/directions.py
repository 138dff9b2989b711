"""The road in both directions, and which of them each car drives."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.track.geometry import Floats
from repaint_cli.envs.racer.track.track import Track

Rows = NDArray[np.int64]


class Directions:
    """A track, the same track reversed, and the direction of each of N cars."""

    def __init__(self, track: Track, n: int) -> None:
        """Let all cars drive the track as it is."""
        self._roads = (track, track.reversed())
        self.reverse = np.zeros(n, np.bool_)
        """Which cars drive the reversed track, (N,)."""

    def road_of(self, row: int) -> Track:
        """Return the track in the direction that a car drives it."""
        return self._roads[int(self.reverse[row])]

    def by_road(self, rows: Rows) -> Iterator[tuple[Track, Rows]]:
        """Yield each direction's road with those of these cars (K,) that drive it, if any."""
        for is_reversed, road in enumerate(self._roads):
            own = rows[self.reverse[rows] == is_reversed]
            if len(own):
                yield road, own

    def nearest_waypoints(self, lap_fractions: Floats) -> Floats:
        """Return the index of each car's nearest waypoint in its own direction, (N,)."""
        nearest = np.empty(len(lap_fractions))
        for road, own in self.by_road(np.arange(len(nearest))):
            nearest[own] = road.nearest_waypoint(lap_fractions[own] * road.length)
        return nearest
