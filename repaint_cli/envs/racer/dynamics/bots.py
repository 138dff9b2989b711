"""Other cars on the road: each keeps a lane at a constant speed, and changes it at times. SI.

A bot's position is an arclength along the centre line and a side: +1 is midway between the centre
line and the inner border, −1 midway to the outer one; between them it changes lanes. Bots do not
brake for other cars, as DeepRacer's do not.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.track.geometry import Floats
from repaint_cli.envs.racer.track.track import Track
from repaint_cli.kernels import kernel

BOT_SPEED = 0.2
"""Along the centre line, so that the true speed differs a little by lane, m/s."""
LEAST_GAP = 2.0
"""Between bots at the start, and from the start line to the first, along the centre line, m."""
LAST_GAP = 1.0
"""From the last bot's place to the start line, m."""
WAIT = (3.0, 5.0)
"""A bot keeps its lane for a time drawn between these, s."""
CHANGE_LENGTH = 1.0
"""Then it changes lanes over this distance, m."""
START_ROOM = 1.0
"""A car does not start in the lane of a bot that is nearer than this along the track, m."""
PAUSE = 2.0
"""All bots of a car stand still this long after one was hit through no fault of the car, s."""
_WAITS = 16  # drawn at the start of an episode, then used again from the first
_HALF_BASE = 0.08  # a bot heads where its axles, this far before and behind its middle, lead it
_REACH = _HALF_BASE / CHANGE_LENGTH  # the front axle changes lanes earlier, the rear one later

X, Y, YAW, SIDE = range(4)
"""Columns of a bot's pose: middle (m), heading (rad) and side, from −1 to 1."""


class Bots:
    """B bots for each of N cars; the attributes are arrays that the methods change in place."""

    def __init__(self, n: int, n_bots: int) -> None:
        """Make N × B bots; `start` puts them on the road."""
        self.poses = np.zeros((n, n_bots, 4))
        """X, Y, YAW, SIDE."""
        self.along = np.zeros((n, n_bots))
        """Arclength from the start line along the centre line, m."""
        self._goal_sides = np.ones((n, n_bots))  # the side that each has or goes to
        self._changed = np.ones((n, n_bots))  # share of the lane change that the middle has done
        self._waits = np.zeros((n, n_bots, _WAITS))  # s
        self._waiting = np.zeros((n, n_bots))  # s left
        self._turns = np.zeros((n, n_bots), np.int64)  # lane changes so far
        self._paused = np.zeros(n)  # s left

    def start(
        self, road: Track, rows: NDArray[np.int64], rngs: Sequence[np.random.Generator]
    ) -> None:
        """Place the bots of these cars (K,) in random lanes, drawn by each car's own generator."""
        n_bots = self.along.shape[1]
        for row, rng in zip(rows, rngs, strict=True):
            self.along[row] = places(n_bots, road.length, rng)
            self._goal_sides[row] = rng.choice([-1.0, 1.0], n_bots)
            self._waits[row] = rng.uniform(*WAIT, (n_bots, _WAITS))
        self._waiting[rows] = self._waits[rows, :, 0]
        self._changed[rows] = 1.0 + _REACH
        self._turns[rows] = 0
        self._paused[rows] = 0.0
        self.drive(road, rows, 0.0)

    def drive(self, road: Track, rows: NDArray[np.int64], seconds: float) -> None:
        """Move the bots of these cars (K,) along a road."""
        drive_bots(
            rows, seconds, *road.lines, self.along, self._goal_sides, self._changed, self._waits,
            self._waiting, self._turns, self._paused, self.poses,
        )  # fmt: skip

    def free_points(self, road: Track, rows: NDArray[np.int64], along: Floats) -> Floats:
        """Return where these cars (K,) start at these arclengths (K,), (K, 2), m.

        A start is on the centre line; with a bot within a metre, in the lane that the bot is not
        going to.
        """
        points = np.empty((len(rows), 2))
        for k, row in enumerate(rows):
            apart = np.abs(self.along[row] - along[k])
            apart = np.minimum(apart, road.length - apart)
            nearest = apart.argmin()
            side = -self._goal_sides[row, nearest] if apart[nearest] < START_ROOM else 0.0
            points[k] = lane_point(*road.lines, along[k], side)
        return points

    def pause(self, rows: NDArray[np.int64]) -> None:
        """Have the bots of these cars (K,) stand still for a while."""
        self._paused[rows] = PAUSE


def places(n_bots: int, length: float, rng: np.random.Generator) -> Floats:
    """Draw where bots start, (B,), m along the centre line.

    They begin evenly spaced; in a random order each is then drawn again from the range that keeps
    2 m to its neighbours, if there is one. On a track too short for that they stay evenly spaced.
    """
    where = np.linspace(min(LEAST_GAP, length / 2), length - min(LAST_GAP, length / 4), n_bots)
    for bot in rng.permutation(n_bots):
        low = where[bot - 1] + LEAST_GAP if bot > 0 else LEAST_GAP
        high = where[bot + 1] - LEAST_GAP if bot < n_bots - 1 else length - LAST_GAP
        if low < high:
            where[bot] = rng.uniform(low, high)
    return where


@kernel
def lane_point(
    centre: np.ndarray,
    distances: np.ndarray,
    inner: np.ndarray,
    outer: np.ndarray,
    along: float,
    side: float,
) -> tuple[float, float]:
    """Return x and y of a place on the road: arclength `along`, side from −1 to 1, m."""
    along = along % distances[-1]
    i = min(int(np.searchsorted(distances, along, side="right")) - 1, len(centre) - 2)
    share = (along - distances[i]) / (distances[i + 1] - distances[i])
    border = inner if side > 0.0 else outer
    reach = abs(side) / 2.0
    x = centre[i, 0] + share * (centre[i + 1, 0] - centre[i, 0])
    y = centre[i, 1] + share * (centre[i + 1, 1] - centre[i, 1])
    bx = border[i, 0] + share * (border[i + 1, 0] - border[i, 0])
    by = border[i, 1] + share * (border[i + 1, 1] - border[i, 1])
    return x + reach * (bx - x), y + reach * (by - y)


@kernel
def side_at(goal: float, changed: float) -> float:
    """Return the side, from −1 to 1, of a bot whose change to `goal` is done by a share."""
    share = min(max(changed, 0.0), 1.0)
    return goal * (2.0 * share * share * (3.0 - 2.0 * share) - 1.0)


@kernel
def drive_bots(
    rows: np.ndarray, seconds: float, centre: np.ndarray, distances: np.ndarray,
    inner: np.ndarray, outer: np.ndarray, along: np.ndarray, goals: np.ndarray,
    changed: np.ndarray, waits: np.ndarray, waiting: np.ndarray, turns: np.ndarray,
    paused: np.ndarray, poses: np.ndarray,
) -> None:  # fmt: skip
    """Move the bots of some cars, in place; `rows` (K,) are row numbers of the `Bots` arrays."""
    for row in rows:
        moving = max(seconds - paused[row], 0.0)
        paused[row] = max(paused[row] - seconds, 0.0)
        for bot in range(along.shape[1]):
            step = BOT_SPEED * moving
            along[row, bot] = (along[row, bot] + step) % distances[-1]
            if changed[row, bot] < 1.0 + _REACH:
                changed[row, bot] += step / CHANGE_LENGTH
            else:
                waiting[row, bot] -= moving
                if waiting[row, bot] <= 0.0:
                    goals[row, bot] = -goals[row, bot]
                    changed[row, bot] = -_REACH
                    turns[row, bot] += 1
                    waiting[row, bot] = waits[row, bot, turns[row, bot] % waits.shape[2]]
            where, goal, share = along[row, bot], goals[row, bot], changed[row, bot]
            side = side_at(goal, share)
            fx, fy = lane_point(
                centre, distances, inner, outer,
                where + _HALF_BASE, side_at(goal, share + _REACH),
            )  # fmt: skip
            rx, ry = lane_point(
                centre, distances, inner, outer,
                where - _HALF_BASE, side_at(goal, share - _REACH),
            )  # fmt: skip
            x, y = lane_point(centre, distances, inner, outer, where, side)
            poses[row, bot, X], poses[row, bot, Y] = x, y
            poses[row, bot, YAW] = np.arctan2(fy - ry, fx - rx)
            poses[row, bot, SIDE] = side
