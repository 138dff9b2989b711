"""Checks that rows of waypoints are a road, before a track is built of them. Metres."""

import numpy as np

from repaint_cli.envs.racer.track.geometry import (
    Floats,
    crosses_itself,
    ring_holds,
    road_ring,
    signed_area,
)

_SAME_POINT = 1e-9  # metres; many published tracks hold one row twice
_MIN_CORNERS = 4
_MAX_ROWS = 5_000
"""Every line is compared with itself, by the square of its rows."""
_MAX_COORDINATE, _MAX_AREA, _MAX_LENGTH = 1e4, 2500.0, 1000.0
"""In m from the origin, m² around the track, and m along a line: the ground is painted at 5 mm a
texel. The largest of DeepRacer's tracks need a tenth of this."""


def checked_rows(waypoints: np.ndarray, name: str) -> Floats:
    """Return waypoints (N, 6) as float64 without repeated rows, (M, 6).

    Raises:
        ValueError: the array has another shape, holds numbers that are not finite, is too large, or
            has too few rows; or its ends nearly meet.
    """
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
    if len(rows) < _MIN_CORNERS + 1:
        raise ValueError(
            f"track '{name}': expected at least {_MIN_CORNERS + 1} rows that differ from their "
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
    """Refuse tracks too large to paint or compare: most of them are in other units than m."""
    if len(rows) > _MAX_ROWS:
        raise ValueError(
            f"track '{name}': expected at most {_MAX_ROWS:,} rows, found {len(rows):,}; thin it"
        )
    if not len(rows):
        return
    if np.abs(rows).max() <= _MAX_COORDINATE:
        area = float(np.ptp(rows[:, ::2]) * np.ptp(rows[:, 1::2]))
        moves = np.diff(rows, axis=0).reshape(-1, 3, 2)
        if area <= _MAX_AREA and np.hypot(moves[..., 0], moves[..., 1]).sum(0).max() <= _MAX_LENGTH:
            return
    raise ValueError(
        f"track '{name}': expected a track within {_MAX_COORDINATE:,.0f} m of the origin, on at "
        f"most {_MAX_AREA:,.0f} m², of lines of at most {_MAX_LENGTH:,.0f} m, found a "
        "larger one; its unit is the metre"
    )


def check_lap(centre: Floats, inner: Floats, outer: Floats, what: str) -> None:
    """Check that three lines are rings, the inner one inside the outer one.

    Raises:
        ValueError: a line encloses no area or crosses itself, or the inner one leaves the outer.
    """
    _check_ring(centre, f"{what}: the centre line")
    _check_ring(inner, f"{what}: the inner border")
    _check_ring(outer, f"{what}: the outer border")
    if not all(ring_holds(outer, x, y) for x, y in inner):
        raise ValueError(
            f"{what}: the inner border must lie inside the outer one; "
            "swap columns 3-4 with columns 5-6, or repair the borders"
        )


def check_open_track(centre: Floats, inner: Floats, outer: Floats, what: str) -> None:
    """Check that the borders of an open track enclose its centre line.

    Raises:
        ValueError: the ring of the borders encloses no area or crosses itself, or the centre line
            leaves it.
    """
    road = road_ring(outer, inner)
    _check_ring(road, f"{what}: the line around the road")
    if not all(ring_holds(road, x, y) for x, y in centre[1:-1]):
        raise ValueError(
            f"{what}: the centre line must lie between the borders; check the order of the columns"
        )


def _check_ring(ring: Floats, what: str) -> None:
    """Refuse rings without area and rings that cross themselves."""
    if abs(signed_area(ring)) < 1e-6:
        raise ValueError(f"{what} must enclose an area, found none; check its columns")
    if crosses_itself(ring):
        raise ValueError(f"{what} must not cross itself, found a crossing; smooth or thin it")
