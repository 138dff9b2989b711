"""The track: a centre line and two borders, checked once. Metres and radians.

A ring is an array (M, 2) whose last row repeats its first;
the three lines of a track that is lapped are rings, those of an open one end elsewhere.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.track.checks import (
    Numbers,
    check_lap,
    check_open_track,
    checked_rows,
    lines_of,
)
from repaint_cli.envs.racer.track.geometry import (
    Floats,
    line_project,
    nearest_rows,
    road_ring,
    signed_area,
)
from repaint_cli.envs.racer.track.repair import repaired


@dataclass(frozen=True, eq=False)
class Track:
    """A road between two borders. Arrays are read-only; equal tracks hash alike."""

    name: str
    """Of the track, for people."""
    centre: Floats
    """Centre line in driving order, (M, 2), m."""
    inner: Floats
    """Border on the infield side, (M, 2), m."""
    outer: Floats
    """Border on the outfield side, (M, 2), m."""
    distances: Floats
    """Arclength of each centre point from the start line, (M,), m; the last is `length`."""
    length: float
    """Length of the centre line, m."""
    width: float
    """Median distance between the borders, m."""
    ccw: bool
    """Whether the inner border is on the left: a lap then runs counter-clockwise."""
    repeats: Numbers
    """How many waypoints each centre point is, (M,): some files hold a row twice."""
    closed: bool = True
    """Whether the end is the start; an open track is driven from one end to the other."""
    note: str = ""
    """What was mended in its rows, for people; "" where nothing was."""

    @classmethod
    def from_waypoints(cls, waypoints: np.ndarray, name: str, *, unique: bool = False) -> "Track":
        """Build a track from rows of (centre x, y, inner x, y, outer x, y), (N, 6), m.

        The last row of a lap repeats the first; otherwise the track is open. A lap that is nearly
        closed is closed, and small loops of its borders are cut; see `repair`.

        Args:
            waypoints: the rows.
            name: of the track.
            unique: whether rows that repeat their predecessor are no waypoints of their own.

        Raises:
            ValueError: the rows have another shape, hold numbers that are not finite, are too few
                or too many, or their lines cross or do not enclose a road.
        """
        rows, numbers, note = repaired(*checked_rows(waypoints, name), name)
        centre, inner, outer = lines_of(rows)
        closed = bool((rows[0] == rows[-1]).all())
        (check_lap if closed else check_open_track)(rows, numbers, f"track '{name}'")
        steps = np.hypot(*np.diff(centre, axis=0).T)  # (M-1,)
        distances = np.concatenate([[0.0], np.cumsum(steps)])
        n_waypoints = max(len(waypoints), int(numbers[-1]) + 1)
        repeats = np.ones_like(numbers) if unique else np.diff(numbers, append=n_waypoints)
        for array in (centre, inner, outer, distances, repeats):
            array.flags.writeable = False
        return cls(
            name=name,
            centre=centre,
            inner=inner,
            outer=outer,
            distances=distances,
            length=float(distances[-1]),
            width=_median_width(centre, inner, outer),
            ccw=signed_area(centre if closed else road_ring(outer, inner)) > 0,
            repeats=repeats,
            closed=closed,
            note=note,
        )

    @property
    def tightest_radius(self) -> float:
        """Least radius of a circle through a centre point and those 0.3 m before and after, m."""
        reach = 0.3 / self.length
        shares = self.distances[:-1] / self.length
        if not self.closed:
            shares = np.clip(shares, reach, 1 - reach)
        a, b, c = (self.pose_at(shares + offset)[0] for offset in (-reach, 0.0, reach))
        (ux, uy), (vx, vy) = (b - a).T, (c - b).T
        sides = np.hypot(ux, uy) * np.hypot(vx, vy) * np.hypot(*(c - a).T)
        twice = np.maximum(2 * np.abs(ux * vy - uy * vx), 1e-12)
        return float((sides / twice).min())

    @property
    def lines(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Centre line, its arclengths, inner and outer border, as the kernels take them."""
        return self.centre, self.distances, self.inner, self.outer

    @cached_property
    def outline(self) -> tuple[Floats, Floats]:
        """The ring around the road, and the ring around what is inside of it but not road."""
        if self.closed:
            return self.outer, self.inner
        return road_ring(self.outer, self.inner), self.inner[:1]  # one point holds nothing

    def reversed(self) -> "Track":
        """Return the same road, driven the other way; its start line stays."""
        turned = (np.ascontiguousarray(r[::-1]) for r in (self.centre, self.inner, self.outer))
        centre, inner, outer = turned
        distances = np.ascontiguousarray(self.length - self.distances[::-1])
        repeats = np.ascontiguousarray(self.repeats[::-1])
        for array in (centre, inner, outer, distances, repeats):
            array.flags.writeable = False
        return replace(
            self, centre=centre, inner=inner, outer=outer, distances=distances, repeats=repeats,
            ccw=not self.ccw,
        )  # fmt: skip

    def pose_at(self, lap_fraction: Floats) -> tuple[Floats, Floats]:
        """Return the points at these fractions of the lap.

        Args:
            lap_fraction: arclength from the start line over the track's length, any shape S; wraps
                at 1 where the track is closed, else ends there.

        Returns:
            points on the centre line (*S, 2), m, and the line's heading there, S, rad.
        """
        shares = np.asarray(lap_fraction, dtype=np.float64)
        along = (np.mod(shares, 1.0) if self.closed else np.clip(shares, 0, 1)) * self.length
        i = np.searchsorted(self.distances, along, side="right") - 1
        i = np.clip(i, 0, len(self.centre) - 2)
        step = self.centre[i + 1] - self.centre[i]  # (*S, 2)
        share = (along - self.distances[i]) / (self.distances[i + 1] - self.distances[i])
        return self.centre[i] + share[..., None] * step, np.arctan2(step[..., 1], step[..., 0])

    @cached_property
    def waypoints(self) -> tuple[Floats, Floats]:
        """The waypoints in driving order, (W, 2), m, and their arclengths, (W,), m."""
        return np.repeat(self.centre, self.repeats, axis=0), np.repeat(self.distances, self.repeats)

    def nearest_waypoint(self, along: Floats) -> NDArray[np.int64]:
        """Return the index of the waypoint nearest to arclengths (m) from the start, any shape."""
        _, places = self.waypoints
        nearest = np.empty(np.shape(along), np.int64)
        nearest_rows(places, np.ravel(along), nearest.reshape(-1))
        return nearest

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Track) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    @property
    def _key(self) -> tuple[str, bytes, bytes, bytes, bytes]:
        arrays = (self.centre, self.inner, self.outer, self.repeats)
        centre, inner, outer, repeats = (array.tobytes() for array in arrays)
        return self.name, centre, inner, outer, repeats


def _median_width(centre: Floats, inner: Floats, outer: Floats) -> float:
    widths = []
    for x, y in centre[:-1]:
        x_in, y_in, _ = line_project(inner, x, y)
        x_out, y_out, _ = line_project(outer, x, y)
        widths.append(np.hypot(x_in - x_out, y_in - y_out))
    return float(np.median(widths))
