"""A track around a centre line that somebody drew: its borders run at half a width. Metres."""

import re
from pathlib import Path

import numpy as np

from repaint_cli.envs.racer.track.checks import checked_rows, these_rows
from repaint_cli.envs.racer.track.geometry import Floats, signed_area
from repaint_cli.envs.racer.track.repair import close
from repaint_cli.envs.racer.track.track import Track
from repaint_cli.errors import CardError, NotFound, StoreError, UsageError, reported_as
from repaint_cli.files.atomic import atomic_write
from repaint_cli.files.limits import read_bytes, read_text
from repaint_cli.files.npy import NotAnArray, read_npy

MIN_WIDTH, MAX_WIDTH = 0.2, 10.0
"""Of a road, m: the car is 0.2 m wide."""
_SHARPEST = np.deg2rad(150)
"""A centre line that turns further at a point runs back where it came from."""
_MAX_MITRE = 2.0
"""A corner of a border is at most so many half widths from its point of the centre line."""


def read_centre_line(file: str) -> Floats:
    """Read points (N, 2), m, from an .npy file or a text of two numbers a line, x and y.

    The numbers are parted by commas, semicolons or spaces. A first line of names is skipped, and so
    are lines that begin with #.

    Raises:
        NotFound: the file does not exist.
        CardError: the file holds something else.
    """
    path = Path(file)
    if not path.exists():
        raise NotFound(f"expected a centre line at '{file:.500}', found none")
    with reported_as(CardError):
        if path.suffix != ".npy":
            return _points_in(read_text(path), file)
        data = read_bytes(path)
    try:
        points = read_npy(data, kinds="fiu")
    except NotAnArray as error:
        raise CardError(f"{file}: expected an array (N, 2) of x and y, found {error}") from error
    if points.ndim != 2 or points.shape[1] != 2:
        raise CardError(f"{file}: expected an array (N, 2) of x and y, found {points.shape}")
    return points.astype(np.float64)


def _points_in(text: str, file: str) -> Floats:
    points: list[list[float]] = []
    has_head = False
    for number, line in enumerate(text.lstrip("\ufeff").splitlines(), 1):
        cells = [cell for cell in re.split(r"[,;\s]+", line) if cell]
        if not cells or cells[0].startswith("#"):
            continue
        try:
            point = [float(cell) for cell in cells]
        except ValueError:
            point = []
        if len(point) == 2:
            points.append(point)
        elif points or point or has_head:
            raise CardError(
                f"{file}: expected two numbers, x and y, found '{line.strip():.60}' in line "
                f"{number}"
            )
        has_head = True
    if not points:
        raise CardError(f"{file}: expected lines of two numbers, x and y, found none")
    return np.array(points)


def rows_around(points: Floats, width: float, name: str) -> tuple[Floats, list[str]]:
    """Return waypoints with borders at half a width on both sides of a centre line.

    Args:
        points: the centre line in driving order, (N, 2), m.
        width: of the road, m.
        name: of the track, for messages.

    Returns:
        rows (M, 6), m, and what was done to close a line whose ends nearly meet. Borders loop in
        corners that are tighter than half the width; `Track.from_waypoints` cuts that.

    Raises:
        ValueError: the points are no line, or turn back; or no infield is left.
    """
    rows, numbers, *done = close(*checked_rows(np.tile(points, 3), name), name)
    line = np.ascontiguousarray(rows[:, :2])
    closed = bool((line[0] == line[-1]).all())
    mitres = _mitres(line, closed=closed)
    if (turns_back := np.isnan(mitres[:, 0])).any():
        raise ValueError(
            f"track '{name}': expected a line that runs on, found that it turns back at "
            f"{these_rows(numbers[turns_back])}; smooth it"
        )
    to_inner = width / 2 * mitres * (-1 if closed and signed_area(line) < 0 else 1)
    inner = line + to_inner
    if closed and signed_area(inner) * signed_area(line) <= 0:
        raise ValueError(
            f"track '{name}': expected an infield, found none beside a road of {width:g} m; try a "
            "smaller width"
        )
    return np.hstack([line, inner, line - to_inner]), done


def _mitres(line: Floats, *, closed: bool) -> Floats:
    """Return from each point of a line to its left the corner of a border at 1 m, (M, 2), m.

    It is NaN where the line turns back.
    """
    ways = np.diff(line, axis=0)
    ways /= np.hypot(ways[:, 0], ways[:, 1])[:, None]
    left = np.stack([-ways[:, 1], ways[:, 0]], axis=1)  # of each segment, (M-1, 2)
    before, after = np.vstack([left[:1], left]), np.vstack([left, left[-1:]])
    if closed:
        before[0], after[-1] = left[-1], left[0]
    cosines = (before * after).sum(axis=1)
    cosines[cosines < np.cos(_SHARPEST)] = np.nan
    mitres = (before + after) / (1 + cosines)[:, None]
    return np.asarray(mitres / np.fmax(np.hypot(*mitres.T) / _MAX_MITRE, 1)[:, None])


def write_track_around(file: str, width: float, path: Path) -> tuple[Track, str]:
    """Write the waypoints of a track around a centre line to a new .npy file.

    Args:
        file: of the centre line.
        width: of the road, m.
        path: of the new file.

    Returns:
        the track, and what was mended, for people.

    Raises:
        NotFound: there is no centre line.
        UsageError: no road is that wide.
        CardError: the file holds no centre line, or the road would overlap itself.
        StoreError: the new file is there already, or cannot be written.
    """
    if not MIN_WIDTH <= width <= MAX_WIDTH:
        raise UsageError(f"expected a --width of {MIN_WIDTH:g} to {MAX_WIDTH:g} m, found {width:g}")
    if path.suffix != ".npy":
        raise StoreError(f"expected a file that ends in .npy, found '{path}'")
    points = read_centre_line(file)
    try:
        rows, done = rows_around(points, width, path.stem)
        track = Track.from_waypoints(rows, path.stem)
    except ValueError as error:
        raise CardError(f"{file}: {error}; the road is {width:g} m wide") from error
    with atomic_write(path, new=True) as temporary:
        np.save(temporary, np.hstack([track.centre, track.inner, track.outer]))
    return track, "; ".join(filter(None, [*done, track.note]))
