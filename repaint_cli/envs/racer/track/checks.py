"""Checks that rows of waypoints are a road, before a track is built of them. Metres.

Messages count rows as the file does, from 0.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.track.geometry import (
    Floats,
    crossings,
    ring_holds,
    road_ring,
    signed_area,
)

Numbers = NDArray[np.int64]

SAME_POINT = 1e-9
"""Coordinates no further apart are the same, m; many published tracks hold one row twice."""
_MIN_CORNERS = 4
_MAX_ROWS = 5_000
"""Every line is compared with itself, by the square of its rows."""
_MAX_COORDINATE, _MAX_AREA, _MAX_LENGTH = 1e4, 2500.0, 1000.0
"""In m from the origin, m² around the track, and m along a line: the ground is painted at 5 mm a
texel. The largest of DeepRacer's tracks need a tenth of this."""
_MOST_NAMED = 8
"""Ranges of rows in a message."""


def checked_rows(waypoints: np.ndarray, name: str) -> tuple[Floats, Numbers]:
    """Return waypoints (N, 6) as float64 without repeated rows, (M, 6), and their numbers, (M,).

    Raises:
        ValueError: the array has another shape, holds numbers that are not finite, is too large, or
            has too few rows.
    """
    rows = np.asarray(waypoints)
    if rows.ndim != 2 or rows.shape[1] != 6:
        raise ValueError(
            f"track '{name}': expected an array of shape (N, 6), found {rows.shape}; "
            "a row is centre x, y, inner x, y, outer x, y"
        )
    if rows.dtype.kind not in "fiu":
        raise ValueError(f"track '{name}': expected finite numbers, found type {rows.dtype}")
    if not np.isfinite(rows).all():
        wrong = np.flatnonzero(~np.isfinite(rows).all(axis=1))
        raise ValueError(
            f"track '{name}': expected finite numbers, found NaN or infinity in {these_rows(wrong)}"
            "; remove those rows"
        )
    with np.errstate(over="ignore"):  # of more than 64 bits
        rows = rows.astype(np.float64)
    _check_size(rows, name)
    numbers = np.arange(len(rows))
    if len(rows):
        moves = np.abs(np.diff(rows, axis=0)).max(axis=1) > SAME_POINT
        numbers = np.flatnonzero(np.concatenate([[True], moves]))
    if len(numbers) < _MIN_CORNERS + 1:
        raise ValueError(
            f"track '{name}': expected at least {_MIN_CORNERS + 1} rows that differ from their "
            f"neighbours, found {len(numbers)}; add waypoints"
        )
    return rows[numbers], numbers


def these_rows(numbers: Iterable[int]) -> str:
    """Return numbers of rows for people, such as "rows 3-5, 9"."""
    ranges: list[list[int]] = []
    for number in sorted({int(number) for number in numbers}):
        if ranges and number == ranges[-1][1] + 1:
            ranges[-1][1] = number
        else:
            ranges.append([number, number])
    named = [f"{a}" if a == b else f"{a}-{b}" for a, b in ranges[:_MOST_NAMED]]
    more = f" and {len(ranges) - _MOST_NAMED} more" if len(ranges) > _MOST_NAMED else ""
    is_one = len(ranges) == 1 and ranges[0][0] == ranges[0][1]
    return f"{'row' if is_one else 'rows'} {', '.join(named)}{more}"


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


def check_lap(rows: Floats, numbers: Numbers, what: str) -> None:
    """Check that the three lines of rows (M, 6) are rings, the inner one inside the outer one.

    Args:
        rows: of which the last repeats the first.
        numbers: of the rows in their file, (M,).
        what: the track, for messages.

    Raises:
        ValueError: a line encloses no area or crosses itself, or the inner one leaves the outer.
    """
    centre, inner, outer = lines_of(rows)
    _check_ring(centre, numbers, f"{what}: the centre line")
    _check_ring(inner, numbers, f"{what}: the inner border")
    _check_ring(outer, numbers, f"{what}: the outer border")
    outside = [n for n, (x, y) in zip(numbers, inner, strict=True) if not ring_holds(outer, x, y)]
    if outside:
        raise ValueError(
            f"{what}: the inner border must lie inside the outer one, found {these_rows(outside)} "
            "outside; swap columns 3-4 with columns 5-6, or repair the borders"
        )


def check_open_track(rows: Floats, numbers: Numbers, what: str) -> None:
    """Check that the borders of an open track enclose its centre line; see `check_lap`.

    Raises:
        ValueError: the ring of the borders encloses no area or crosses itself, or the centre line
            leaves it.
    """
    centre, inner, outer = lines_of(rows)
    road = road_ring(outer, inner)
    around = np.concatenate([numbers, numbers[::-1], numbers[:1]])
    _check_ring(road, around, f"{what}: the line around the road")
    points = zip(numbers[1:-1], centre[1:-1], strict=True)
    outside = [n for n, (x, y) in points if not ring_holds(road, x, y)]
    if outside:
        raise ValueError(
            f"{what}: the centre line must lie between the borders, found {these_rows(outside)} "
            "outside; check the order of the columns"
        )


def lines_of(rows: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the centre line, inner and outer border, (M, 2) each, of rows (M, 6)."""
    centre, inner, outer = (np.ascontiguousarray(rows[:, k : k + 2]) for k in (0, 2, 4))
    return centre, inner, outer


def _check_ring(ring: Floats, numbers: Numbers, what: str) -> None:
    """Refuse rings without area and rings that cross themselves."""
    if abs(signed_area(ring)) < 1e-6:
        raise ValueError(f"{what} must enclose an area, found none; check its columns")
    pair = np.zeros((1, 2), np.int64)
    if crossings(ring, pair):
        (i, j), last = pair[0], len(ring) - 1
        ends = these_rows(numbers[[i, i + 1]]), these_rows(numbers[[j, min(j + 1, last)]])
        raise ValueError(
            f"{what} must not cross itself, found a crossing of {ends[0]} with {ends[1]}; "
            "smooth or thin it"
        )
