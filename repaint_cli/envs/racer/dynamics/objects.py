"""What stands or drives on the road besides the car: bots, or boxes. SI.

A car has the one or the other, as DeepRacer's race types have. See `bots` for places and sides.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.dynamics.bots import HALF_BASE, drive_bots, lane_point
from repaint_cli.envs.racer.dynamics.encounters import BODY_LENGTH, BODY_WIDTH
from repaint_cli.envs.racer.track.geometry import Floats
from repaint_cli.envs.racer.track.track import Track

LAST_GAP = 1.0
"""From the last object's place to the start line, m."""
START_ROOM = 1.0
"""A car does not start in the lane of an object that is nearer than this along the track, m."""
PAUSE = 2.0
"""All bots of a car stand still this long after one was hit through no fault of the car, s."""
BUFFER = 0.1
"""A box is so much longer and wider for crashes than it is to see, as DeepRacer's, m."""
WAITS = 16
"""Times between lane changes that are drawn for an episode, then used again from the first."""


@dataclass(frozen=True)
class ObjectSettings:
    """What is on the road, and how it is placed and moves."""

    n: int = 0
    """B, how many for each car."""
    boxes: bool = False
    """Whether they are boxes, or bots."""
    speed: float = 0.2
    """Of bots along the centre line, so that the true speed differs a little by lane, m/s."""
    lane_changes: bool = True
    """Whether bots change lanes."""
    waits: tuple[float, float] = (3.0, 5.0)
    """A bot keeps its lane for a time drawn between these, s."""
    change_length: float = 1.0
    """Then it changes lanes over this distance, m."""
    gap: float = 2.0
    """Between objects at the start, and from the start line to the first, m."""
    random: bool = True
    """Whether places and lanes are drawn in each episode; else they are even, and lanes alternate,
    the inner one first."""
    places: tuple[tuple[float, int], ...] = ()
    """Given instead: shares of the lap, and lanes, 1 the inner one and −1 the outer, (B, 2)."""
    box_size: tuple[float, float, float] = (0.3, 0.4, 0.25)
    """Of a box to see: along the road, across it, and its height, m."""

    @property
    def body(self) -> Floats:
        """Length and width of an object for crashes, (2,), m."""
        length, width, _ = self.box_size
        size = [length + BUFFER, width + BUFFER] if self.boxes else [BODY_LENGTH, BODY_WIDTH]
        return np.array(size)


class Objects:
    """B objects for each of N cars; the attributes are arrays that the methods change in place."""

    def __init__(self, n: int, settings: ObjectSettings) -> None:
        """Make N × B objects; `start` puts them on the road."""
        self.settings, n_objects = settings, settings.n
        self.body = settings.body
        """Length and width for crashes, (2,), m."""
        self.speed = 0.0 if settings.boxes else settings.speed
        """Along the centre line, m/s."""
        self.poses = np.zeros((n, n_objects, 4))
        """X, Y, YAW, SIDE."""
        self.along = np.zeros((n, n_objects))
        """Arclength from the start line along the centre line, m."""
        self.goal_sides = np.ones((n, n_objects))
        """The side that each has or goes to."""
        self._changed = np.ones((n, n_objects))
        self.waits = np.full((n, n_objects, WAITS), np.inf)
        """Times between its lane changes, s."""
        self._waiting = np.zeros((n, n_objects))
        self._n_changes = np.zeros((n, n_objects), np.int64)
        self._paused = np.zeros(n)

    def start(
        self, road: Track, rows: NDArray[np.int64], rngs: Sequence[np.random.Generator]
    ) -> None:
        """Place the objects of these cars (K,), drawn by each car's own generator where random."""
        settings = self.settings
        for row, rng in zip(rows, rngs, strict=True):
            self.along[row], self.goal_sides[row] = places(settings, road.length, rng)
            if self.speed and settings.lane_changes:
                self.waits[row] = rng.uniform(*settings.waits, (settings.n, WAITS))
        self._waiting[rows] = self.waits[rows, :, 0]
        self._changed[rows] = 1.0 + HALF_BASE / settings.change_length
        self._n_changes[rows] = 0
        self._paused[rows] = 0.0
        self._move(road, rows, 0.0)

    def drive(self, road: Track, rows: NDArray[np.int64], seconds: float) -> None:
        """Move the objects of these cars (K,) along a road."""
        if self.speed:
            self._move(road, rows, seconds)

    def _move(self, road: Track, rows: NDArray[np.int64], seconds: float) -> None:
        drive_bots(
            rows, seconds, self.speed, self.settings.change_length, *road.lines, self.along,
            self.goal_sides, self._changed, self.waits, self._waiting, self._n_changes,
            self._paused, self.poses,
        )  # fmt: skip

    def free_points(self, road: Track, rows: NDArray[np.int64], along: Floats) -> Floats:
        """Return where these cars (K,) start at these arclengths (K,), (K, 2), m.

        A start is on the centre line; with an object within a metre, in the lane that it does not
        have or go to.
        """
        points = np.empty((len(rows), 2))
        for k, row in enumerate(rows):
            apart = np.abs(self.along[row] - along[k])
            apart = np.minimum(apart, road.length - apart)
            nearest = apart.argmin()
            side = -self.goal_sides[row, nearest] if apart[nearest] < START_ROOM else 0.0
            points[k] = lane_point(*road.lines, along[k], side)
        return points

    def pause(self, rows: NDArray[np.int64]) -> None:
        """Have the bots of these cars (K,) stand still for a while."""
        self._paused[rows] = PAUSE


def places(
    settings: ObjectSettings, length: float, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Return where objects start: m along the centre line, and sides, both (B,).

    They begin evenly spaced. Where random, each is then drawn again, in a random order, from the
    range that keeps the gap to its neighbours, if there is one; on a track too short for that they
    stay evenly spaced. Lanes are drawn, too.
    """
    n, gap = settings.n, settings.gap
    if settings.places:
        given = np.array(settings.places, np.float64)
        return given[:, 0] % 1.0 * length, given[:, 1]
    where = np.linspace(min(gap, length / 2), length - min(LAST_GAP, length / 4), n)
    if not settings.random:
        return where, np.where(np.arange(n) % 2 == 0, 1.0, -1.0)
    for k in rng.permutation(n):
        low = where[k - 1] + gap if k > 0 else gap
        high = where[k + 1] - gap if k < n - 1 else length - LAST_GAP
        if low < high:
            where[k] = rng.uniform(low, high)
    return where, rng.choice([-1.0, 1.0], n)
