"""Where episodes start: places drawn by each car's own generator, and the objects around them."""

from collections.abc import Sequence

import numpy as np

from repaint_cli.envs.racer.dynamics.directions import Rows
from repaint_cli.envs.racer.dynamics.objects import Objects
from repaint_cli.envs.racer.track.geometry import Floats
from repaint_cli.envs.racer.track.track import Track

START_PLACES = 20
"""Evenly spaced places on the lap, of which each episode draws its start."""
OPEN_START = 0.2
"""From the start of an open track to a starting car's base, so that all wheels are on it, m."""


def drawn_fractions(rows: Rows, rngs: Sequence[np.random.Generator]) -> Floats:
    """Return drawn lap fractions of these cars (K,), (N,); 0 for others."""
    fractions = np.zeros(len(rngs))
    for row in rows:
        fractions[row] = rngs[row].integers(START_PLACES) / START_PLACES
    return fractions


def placed(
    road: Track, rows: Rows, fractions: Floats, objects: Objects | None,
    rngs: Sequence[np.random.Generator],
) -> tuple[Floats, Floats]:  # fmt: skip
    """Put the objects of cars on a road, and return where the cars start on it.

    Where an object is within a metre, the car starts in the lane that it is not in, else on the
    centre line. An open track is always driven from its beginning.

    Args:
        road: in the cars' own direction.
        rows: which cars, (K,).
        fractions: of the lap where they start, (N,).
        objects: of all cars, or None.
        rngs: each car's own generator, which places its objects, (N,).

    Returns:
        the lap fractions from which progress counts, (K,), and x, y (m) and heading (rad), (K, 3).
    """
    starts = fractions[rows] if road.closed else np.zeros(len(rows))
    places = starts if road.closed else np.full(len(rows), OPEN_START / road.length)
    points, headings = road.pose_at(places)
    if objects is not None:
        objects.start(road, rows, [rngs[row] for row in rows])
        points = objects.free_points(road, rows, places * road.length)
    return starts, np.column_stack([points, headings])
