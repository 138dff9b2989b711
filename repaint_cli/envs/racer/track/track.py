"""The track: a centre line and two borders, checked once. Metres and radians.

Knows nothing of files, cars or cameras. A ring is an array (M, 2) whose last row repeats its first;
the three lines of a track that is lapped are rings, those of an open one end elsewhere.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.track.geometry import crosses_itself, line_project, ring_holds

Floats = NDArray[np.float64]

_SAME_POINT = 1e-9  # metres; many published tracks hold one row twice
_LEAST_CORNERS = 4
_MOST_ROWS = 5_000
"""Every line is compared with itself, by the square of its rows."""
_FARTHEST, _MOST_AREA, _LONGEST = 1e4, 2500.0, 1000.0
"""Metres from the origin, square metres around the track, metres of a line: its ground is painted
at 5 mm, and the largest of DeepRacer's tracks need a tenth of it."""


@dataclass(frozen=True, eq=False)
class Track:
    """A road between two borders. Arrays are read-only; equal tracks hash alike."""

    name: str
    """What people call it."""
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
    closed: bool = True
    """Whether the end is the start; an open track is driven from one end to the other."""

    @classmethod
    def from_waypoints(cls, waypoints: np.ndarray, name: str) -> "Track":
        """Build a track from rows of (centre x, y, inner x, y, outer x, y), (N, 6), m.

        The last row of a lap repeats the first; otherwise the track is open. Rows that repeat their
        predecessor are dropped.

        Raises:
            ValueError: the rows are no road; the message says what was wanted and what was found.
        """
        rows = _checked_rows(waypoints, name)
        centre, inner, outer = (np.ascontiguousarray(rows[:, k : k + 2]) for k in (0, 2, 4))
        closed = bool((rows[0] == rows[-1]).all())
        (_check_lap if closed else _check_lane)(centre, inner, outer, f"track '{name}'")
        steps = np.hypot(*np.diff(centre, axis=0).T)  # (M-1,)
        distances = np.concatenate([[0.0], np.cumsum(steps)])
        for array in (centre, inner, outer, distances):
            array.flags.writeable = False
        return cls(
            name=name,
            centre=centre,
            inner=inner,
            outer=outer,
            distances=distances,
            length=float(distances[-1]),
            width=_median_width(centre, inner, outer),
            ccw=_signed_area(centre if closed else _around(outer, inner)) > 0,
            closed=closed,
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
        return _around(self.outer, self.inner), self.inner[:1]  # one point holds nothing

    def reversed(self) -> "Track":
        """Return the same road, driven the other way; its start line stays."""
        turned = (np.ascontiguousarray(r[::-1]) for r in (self.centre, self.inner, self.outer))
        centre, inner, outer = turned
        distances = np.ascontiguousarray(self.length - self.distances[::-1])
        for array in (centre, inner, outer, distances):
            array.flags.writeable = False
        return replace(
            self, centre=centre, inner=inner, outer=outer, distances=distances, ccw=not self.ccw
        )

    def pose_at(self, lap_fraction: Floats) -> tuple[Floats, Floats]:
        """Find the places at these fractions of the lap.

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

    def nearest_waypoint(self, along: Floats) -> NDArray[np.int64]:
        """Return the index of the waypoint nearest to arclengths (m) from the start, any shape."""
        after = np.clip(np.searchsorted(self.distances, along), 1, len(self.distances) - 1)
        here, ahead = along - self.distances[after - 1], self.distances[after] - along
        return np.where(here <= ahead, after - 1, after)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Track) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    @property
    def _key(self) -> tuple[str, bytes, bytes, bytes]:
        return self.name, self.centre.tobytes(), self.inner.tobytes(), self.outer.tobytes()


def _checked_rows(waypoints: np.ndarray, name: str) -> Floats:
    """Return the waypoints as a closed float array without repeated rows, (M, 6)."""
    rows = np.asarray(waypoints)
    if rows.ndim != 2 or rows.shape[1] != 6:
        raise ValueError(
            f"track '{name}': expected an array of shape (N, 6), found {rows.shape}; "
            "a row is centre x, y, inner x, y, outer x, y"
        )
    if rows.dtype.kind not in "fiu" or not np.isfinite(rows).all():
        raise ValueError(
            f"track '{name}': expected finite numbers, found NaN, infinity or another type "
            f"({rows.dtype}); remove those rows"
        )
    with np.errstate(over="ignore"):  # of more than 64 bits
        rows = rows.astype(np.float64)
    _check_size(rows, name)
    if len(rows):
        moves = np.abs(np.diff(rows, axis=0)).max(axis=1) > _SAME_POINT
        rows = rows[np.concatenate([[True], moves])]
    if len(rows) < _LEAST_CORNERS + 1:
        raise ValueError(
            f"track '{name}': expected at least {_LEAST_CORNERS + 1} rows that differ from their "
            f"neighbours, found {len(rows)}; add waypoints"
        )
    ends_apart = np.abs(rows[-1] - rows[0]).max()
    if ends_apart <= _SAME_POINT:
        rows[-1] = rows[0]
        return rows
    spacing = float(np.median(np.hypot(*np.diff(rows[:, :2], axis=0).T)))
    if np.hypot(*(rows[-1] - rows[0])[:2]) <= 2 * spacing:
        raise ValueError(
            f"track '{name}': expected the last row to repeat the first, or the ends of an open "
            f"track to be far apart, found them {ends_apart:.3g} m apart; append the first row"
        )
    return rows


def _check_size(rows: Floats, name: str) -> None:
    """Refuse what cannot be painted or compared in reasonable time: mostly, other units than m."""
    if len(rows) > _MOST_ROWS:
        raise ValueError(
            f"track '{name}': expected at most {_MOST_ROWS:,} rows, found {len(rows):,}; thin it"
        )
    if not len(rows):
        return
    if np.abs(rows).max() <= _FARTHEST:
        area = float(np.ptp(rows[:, ::2]) * np.ptp(rows[:, 1::2]))
        moves = np.diff(rows, axis=0).reshape(-1, 3, 2)
        if area <= _MOST_AREA and np.hypot(moves[..., 0], moves[..., 1]).sum(0).max() <= _LONGEST:
            return
    raise ValueError(
        f"track '{name}': expected a track within {_FARTHEST:,.0f} m of the origin, on at most "
        f"{_MOST_AREA:,.0f} m², of lines of at most {_LONGEST:,.0f} m, found a larger one; "
        "its unit is the metre"
    )


def _check_lap(centre: Floats, inner: Floats, outer: Floats, what: str) -> None:
    """Refuse lines that are no rings one inside the other."""
    _check_ring(centre, f"{what}: the centre line")
    _check_ring(inner, f"{what}: the inner border")
    _check_ring(outer, f"{what}: the outer border")
    if not all(ring_holds(outer, x, y) for x, y in inner):
        raise ValueError(
            f"{what}: the inner border must lie inside the outer one; "
            "swap columns 3-4 with columns 5-6, or repair the borders"
        )


def _check_lane(centre: Floats, inner: Floats, outer: Floats, what: str) -> None:
    """Refuse an open track whose borders do not enclose its centre line."""
    road = _around(outer, inner)
    _check_ring(road, f"{what}: the line around the road")
    if not all(ring_holds(road, x, y) for x, y in centre[1:-1]):
        raise ValueError(
            f"{what}: the centre line must lie between the borders; check the order of the columns"
        )


def _around(outer: Floats, inner: Floats) -> Floats:
    """Return the ring along the outer border of an open track and back along the inner one."""
    return np.concatenate([outer, inner[::-1], outer[:1]])


def _check_ring(ring: Floats, what: str) -> None:
    """Refuse rings without area and rings that cross themselves."""
    if abs(_signed_area(ring)) < 1e-6:
        raise ValueError(f"{what} must enclose an area, found none; check its columns")
    if crosses_itself(ring):
        raise ValueError(f"{what} must not cross itself, found a crossing; smooth or thin it")


def _signed_area(ring: Floats) -> float:
    """Return the shoelace area, m²; positive for counter-clockwise rings."""
    x, y = ring[:-1].T
    x_next, y_next = ring[1:].T
    return float(np.sum(x * y_next - x_next * y) / 2)


def _median_width(centre: Floats, inner: Floats, outer: Floats) -> float:
    widths = []
    for x, y in centre[:-1]:
        x_in, y_in, _ = line_project(inner, x, y)
        x_out, y_out, _ = line_project(outer, x, y)
        widths.append(np.hypot(x_in - x_out, y_in - y_out))
    return float(np.median(widths))
