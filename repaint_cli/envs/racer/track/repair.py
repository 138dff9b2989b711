"""Small faults of tracks that people drew: ends that nearly meet, loops of borders. Metres.

A border that was drawn at a distance from its centre line runs backwards in a corner tighter than
that distance, and crosses itself: the small loop is no part of the road.
"""

from typing import NamedTuple

import numpy as np

from repaint_cli.envs.racer.track.checks import SAME_POINT, Numbers, lines_of, these_rows
from repaint_cli.envs.racer.track.geometry import Floats, crossings, ring_holds

_LARGEST_LOOP = 0.25
"""Of a border's length: a longer one is no loop of a corner."""
_MAX_PASSES = 30
"""Each of them cuts all loops that do not touch one another; loops within loops are few."""


class Repaired(NamedTuple):
    """Rows of waypoints without small faults."""

    rows: Floats
    """(M, 6), m; of a lap the last repeats the first."""
    numbers: Numbers
    """Of the rows in their file, from 0, (M,)."""
    note: str
    """What was done, at which rows, for people; "" where nothing was."""


def repaired(rows: Floats, numbers: Numbers, name: str) -> Repaired:
    """Close what is nearly closed, and cut small loops of borders; sound rows stay as they are.

    Args:
        rows: of which none repeats its predecessor, (M, 6), m.
        numbers: of the rows in their file, (M,).
        name: of the track, for messages.

    Raises:
        ValueError: borders end far from their start, or the centre line leaves the road where loops
            are cut.
    """
    rows, numbers, *done = close(rows, numbers, name)
    closed = bool((rows[0] == rows[-1]).all())
    cut = np.zeros(len(rows), np.bool_)
    centre, *borders = lines_of(rows)
    # where the centre line crosses itself too, a crossing of borders is no loop of theirs
    sound = not crossings(centre, np.zeros((1, 2), np.int64))
    for k, line in enumerate(borders if sound else ()):
        columns, border = slice(2 + 2 * k, 4 + 2 * k), ("inner", "outer")[k]
        looped = cut_loops(line, closed=closed)
        if looped.any():
            rows, cut = rows.copy(), cut | looped
            rows[:, columns] = line
            done.append(f"loops of the {border} border cut at {these_rows(numbers[looped])}")
    if closed and cut.any():
        _check_centre(rows, numbers, name)
    note = f"{'; '.join(done)} (rows count from 0)" if done else ""
    return Repaired(rows, numbers, note)


def close(rows: Floats, numbers: Numbers, name: str) -> tuple[Floats, Numbers, *tuple[str, ...]]:
    """Return rows whose last is the first, where their ends nearly meet, and what was done.

    Args:
        rows: as `repaired` takes them.
        numbers: of the rows.
        name: of the track.

    Raises:
        ValueError: the centre line is closed, and the borders end far from their start.
    """
    rows = rows.copy()
    ends = (rows[-1] - rows[0]).reshape(3, 2)
    if np.abs(ends).max() <= SAME_POINT:
        rows[-1] = rows[0]
        return rows, numbers
    gap, *aside = np.hypot(ends[:, 0], ends[:, 1]).tolist()
    steps = np.hypot(*np.diff(rows[:, :2], axis=0).T)
    spacing = float(np.median(steps))
    if gap > max(2 * spacing, 1.5 * steps[[0, -1]].max()):
        return rows, numbers  # an open track
    if gap > min(spacing, steps[[0, -1]].mean()) / 2:  # points may be closer together there
        numbers = np.append(numbers, numbers[-1] + 1)
        return np.vstack([rows, rows[:1]]), numbers, f"closed over a gap of {_mm(gap)}"
    room = float(np.hypot(*(rows[0, 2:4] - rows[0, 4:]))) / 2
    last = these_rows(numbers[-1:])
    if max(aside) > room + gap:
        raise ValueError(
            f"track '{name}': expected the borders to end where they start, as the centre line "
            f"does, found {last} {max(aside):.2g} m beside row 0; repair the borders"
        )
    rows[-1] = rows[0]
    if np.abs(rows[-2] - rows[-1]).max() <= SAME_POINT:
        rows, numbers = rows[:-1], numbers[:-1]
    return rows, numbers, f"closed by moving {last} onto row 0, {_mm(max(gap, *aside))} away"


def _mm(metres: float) -> str:
    return f"{1000 * metres:.2g} mm" if metres < 0.0995 else f"{metres:.2g} m"


def cut_loops(line: Floats, *, closed: bool) -> np.ndarray:
    """Replace the points of a border's small loops by the points where it crosses itself.

    The number of points stays, so that each still belongs to its point of the centre line. The
    smallest loops are cut first; what crosses itself in larger ones is left as it is, and so is a
    line of more crossings than points, which is no border.

    Args:
        line: changed in place, (M, 2), m.
        closed: whether it is a ring.

    Returns:
        which points were replaced, (M,).
    """
    changed = np.zeros(len(line), np.bool_)
    pairs = np.zeros((len(line), 2), np.int64)
    for _ in range(_MAX_PASSES):
        if (found := crossings(line, pairs)) == len(pairs):
            break
        loops = _small_loops(line, pairs[:found], closed=closed)
        taken = np.zeros(len(line), np.bool_)
        for i, j, members in loops:
            touched = [i, i + 1, j, j + 1, *members]
            if not taken[touched].any():
                taken[touched] = True
                line[members] = _crossing_point(line, i, j)
                changed[members] = True
        if not loops:
            break
    return changed


def _small_loops(line: Floats, pairs: Numbers, *, closed: bool) -> list[tuple[int, int, Numbers]]:
    """Return segments that cross, and the points of the loop between them, smallest loop first."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    m, loops = len(line), []
    for i, j in pairs.tolist():
        point = _crossing_point(line, i, j)
        within = along[j] + np.hypot(*(point - line[j])) - along[i] - np.hypot(*(point - line[i]))
        around = along[-1] - within if closed else np.inf
        if min(within, around) <= _LARGEST_LOOP * along[-1]:
            members = np.arange(i + 1, j + 1)
            if around < within:  # through the start of the ring
                members = np.concatenate([np.arange(j + 1, m), np.arange(i + 1)])
            loops.append((min(within, around), i, j, members))
    loops.sort(key=lambda loop: loop[:3])
    return [loop[1:] for loop in loops]


def _crossing_point(line: Floats, i: int, j: int) -> Floats:
    """Return where segments i and j cross, (2,), m."""
    a, c = line[i], line[j]
    (ux, uy), (vx, vy) = line[i + 1] - a, line[j + 1] - c
    slant = ux * vy - uy * vx
    if slant == 0.0:  # both are shorter than what floats tell apart
        return np.asarray(line[i + 1].copy())
    share = ((c[0] - a[0]) * vy - (c[1] - a[1]) * vx) / slant
    return np.asarray(a + min(max(share, 0.0), 1.0) * np.array([ux, uy]))


def _check_centre(rows: Floats, numbers: Numbers, name: str) -> None:
    """Refuse a lap whose centre line has left the road with a loop that was cut."""
    centre, inner, outer = lines_of(rows)
    points = zip(numbers, centre, strict=True)
    off = [n for n, (x, y) in points if ring_holds(inner, x, y) or not ring_holds(outer, x, y)]
    if off:
        raise ValueError(
            f"track '{name}': the borders cross themselves, and without their loops the centre "
            f"line leaves the road at {these_rows(off)}; repair the borders there"
        )
