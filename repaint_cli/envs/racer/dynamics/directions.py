"""The tracks in both directions, and which of them each car drives in which direction."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.track.geometry import Floats
from repaint_cli.envs.racer.track.track import Track

Rows = NDArray[np.int64]


def several(track: Track | Sequence[Track]) -> tuple[Track, ...]:
    """Return one track or several as several.

    Raises:
        ValueError: there is none.
    """
    tracks = (track,) if isinstance(track, Track) else tuple(track)
    if not tracks:
        raise ValueError("expected at least one track, found none")
    return tracks


class Directions:
    """Tracks, the same tracks reversed, and which of them each of N cars drives."""

    def __init__(self, tracks: Sequence[Track], n: int) -> None:
        """Let all cars drive the first track as it is."""
        self._tracks = tuple((track, track.reversed()) for track in tracks)
        self.track = np.zeros(n, np.int64)
        """Which track each car drives, from 0, (N,)."""
        self.reverse = np.zeros(n, np.bool_)
        """Which cars drive it reversed, (N,)."""

    def road_of(self, row: int) -> Track:
        """Return the track of a car in the direction that the car drives it."""
        forward, back = self._tracks[int(self.track[row])]
        return back if self.reverse[row] else forward

    def by_track(self, rows: Rows) -> Iterator[tuple[int, Rows]]:
        """Yield each track's number with those of these cars (K,) that drive it, if any."""
        for track in range(len(self._tracks)):
            own = rows[self.track[rows] == track] if len(self._tracks) > 1 else rows
            if len(own):
                yield track, own

    def by_road(self, rows: Rows) -> Iterator[tuple[Track, Rows]]:
        """Yield each track in each direction with those of these cars (K,) that drive it so."""
        for track, own in self.by_track(rows):
            for is_reversed, road in enumerate(self._tracks[track]):
                way = own[self.reverse[own] == is_reversed]
                if len(way):
                    yield road, way

    def poses_at(self, lap_fractions: Floats) -> tuple[Floats, Floats]:
        """Return the place at each car's lap fraction (N,) on its road, and the heading there.

        Returns:
            points on the centre line (N, 2), m, and headings (N,), rad.
        """
        n = len(lap_fractions)
        points, headings = np.empty((n, 2)), np.empty(n)
        for road, own in self.by_road(np.arange(n)):
            points[own], headings[own] = road.pose_at(lap_fractions[own])
        return points, headings

    def each(self, name: str) -> Floats:
        """Return a number of each car's track, (N,), such as its "length" or "width"."""
        return np.array([getattr(road, name) for road, _ in self._tracks])[self.track]

    def nearest_waypoints(self, lap_fractions: Floats) -> Floats:
        """Return the index of each car's nearest waypoint on its own road, (N,)."""
        nearest = np.empty(len(lap_fractions))
        for road, own in self.by_road(np.arange(len(nearest))):
            nearest[own] = road.nearest_waypoint(lap_fractions[own] * road.length)
        return nearest


class TrackSchedule:
    """Which of several tracks each of N cars drives in its next episode."""

    def __init__(self, n_tracks: int, n: int) -> None:
        """Let each car's own generator draw its tracks, until `begin` names them."""
        self._n_tracks, self._next = n_tracks, np.zeros(n, np.int64)
        self._drawn = n_tracks > 1

    def begin(self, tracks: Rows | None) -> None:
        """Set the tracks of the next episodes, (N,); cars draw theirs where absent."""
        self._drawn = tracks is None and self._n_tracks > 1
        if tracks is not None:
            self._next = tracks

    def take(self, rows: Rows, rngs: Sequence[np.random.Generator]) -> Rows:
        """Return the tracks that these cars (K,) drive now, (N,), and let them go on to the next.

        Args:
            rows: which cars begin an episode.
            rngs: each car's own generator, (N,).
        """
        if self._drawn:
            for row in rows:
                self._next[row] = rngs[row].integers(self._n_tracks)
        tracks = self._next.copy()
        self._next[rows] = (tracks[rows] + 1) % self._n_tracks
        return tracks
