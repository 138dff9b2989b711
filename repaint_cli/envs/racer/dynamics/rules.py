"""The rules of an episode: progress, how it ends, the reward terms φ. Plain numpy over all cars.

Progress is a percentage of the lap since the start; the other units are SI.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.dynamics.encounters import CLEAR, DISTANCE, HAZARDS, NEXT_SEEN
from repaint_cli.envs.racer.names import STATUS
from repaint_cli.envs.racer.track.geometry import (
    CENTRE_GAP,
    INNER_GAP,
    OUTER_GAP,
    ROAD_WIDTH,
    WHEELS_ON,
    Floats,
)

IN_PROGRESS, LAP_COMPLETE, OFF_TRACK, IMMOBILIZED, REVERSED, TIME_UP, CRASHED = range(len(STATUS))

PATIENCE = 15
"""Steps in a row without movement, or with falling progress, that end an episode."""
STILL = 0.0003
"""A base that moves no further than this in a step has not moved, m."""
KEEP_MARGIN = 0.05
"""Room between the front point and the road's edge that counts as keeping the road, m."""


def progress_since(ndist: Floats, start_ndist: Floats, previous: Floats) -> Floats:
    """Return the percentage of the lap driven since the start, (N,), at most 100.

    The lap fraction jumps at the start line and is ambiguous behind the start; of the candidates a
    lap apart the result is the one within half a lap of the previous progress. It is negative for a
    car behind its start.

    Args:
        ndist: lap fraction of the front point, (N,).
        start_ndist: lap fraction of the episode's start, (N,).
        previous: progress one step ago, (N,); 0 before the first.
    """
    progress = 100 * (ndist - start_ndist)
    progress = np.where(progress <= 0, progress + 100, progress)
    progress = np.where(previous > progress + 50, progress + 100, progress)
    progress = np.where(progress > previous + 50, progress - 100, progress)
    return np.minimum(progress, 100)


@dataclass
class Counters:
    """How long each car has been in trouble, and on the road."""

    steps: NDArray[np.int64]
    """Steps of this episode, (N,)."""
    still: NDArray[np.int64]
    """Steps in a row without movement, (N,)."""
    backwards: NDArray[np.int64]
    """Steps in a row with falling progress, (N,)."""

    @classmethod
    def zeros(cls, n: int) -> "Counters":
        """Make the counters of N cars."""
        return cls(*(np.zeros(n, dtype=np.int64) for _ in range(3)))

    def clear(self, rows: NDArray[np.int64]) -> None:
        """Start new episodes in these rows, (K,)."""
        for counter in (self.steps, self.still, self.backwards):
            counter[rows] = 0

    def clear_trouble(self, rows: NDArray[np.int64]) -> None:
        """Let these rows (K,) go on in their episodes as if they had moved."""
        for counter in (self.still, self.backwards):
            counter[rows] = 0

    def count(self, rows: NDArray[np.int64], moved: Floats, gained: Floats) -> None:
        """Count a step of rows (K,): how far each base moved (K,), m; progress gained (K,)."""
        self.steps[rows] += 1
        self.still[rows] = np.where(moved <= STILL, self.still[rows] + 1, 0)
        self.backwards[rows] = np.where(gained < 0, self.backwards[rows] + 1, 0)


def status_of(
    measures: Floats,
    progress: Floats,
    counters: Counters,
    max_steps: int,
    crashed: NDArray[np.bool_],
) -> NDArray[np.int64]:
    """Return each car's status, (N,): leaving the track outranks the rest, the time limit is last.

    But coming all the way round outranks leaving the track there, as in DeepRacer's logs; at the
    end of an open track the road ends, too.

    Args:
        measures: `geometry.locate`'s answers, (N, 6).
        progress: percent, (N,).
        counters: of the same cars.
        max_steps: the time limit, steps.
        crashed: whether it hit an object and that ends the episode, (N,).
    """
    arrived = progress >= 100
    return np.select(
        [
            (measures[:, WHEELS_ON] == 0) & ~arrived,
            crashed,
            arrived,
            counters.still >= PATIENCE,
            counters.backwards >= PATIENCE,
            counters.steps >= max_steps,
        ],
        [OFF_TRACK, CRASHED, LAP_COMPLETE, IMMOBILIZED, REVERSED, TIME_UP],
        IN_PROGRESS,
    )


def reward_terms(measures: Floats, gained: Floats, status: NDArray[np.int64]) -> dict[str, Floats]:
    """Return the reward terms φ of one step, each (N,).

    lane is +1 with the front point nearer the inner border, −1 nearer the outer, 0 with no wheel on
    the road. keep is 1 with all wheels on the road and the front point at least 0.05 m inside its
    edge. dprog is the progress gained, in laps. fail is 1 on the step that leaves the track or
    crashes.

    Args:
        measures: `geometry.locate`'s answers, (N, 6).
        gained: progress gained in this step, percent, (N,).
        status: `status_of` after this step, (N,).
    """
    wheels_on = measures[:, WHEELS_ON]
    side = np.where(measures[:, INNER_GAP] < measures[:, OUTER_GAP], 1.0, -1.0)
    room = measures[:, ROAD_WIDTH] / 2 - measures[:, CENTRE_GAP]
    return {
        "lane": np.where(wheels_on > 0, side, 0.0),
        "keep": ((wheels_on == 4) & (room >= KEEP_MARGIN)).astype(np.float64),
        "dprog": gained / 100,
        "fail": ((status == OFF_TRACK) | (status == CRASHED)).astype(np.float64),
    }


def traffic_terms(encounters: Floats, next_sides: Floats, lane: Floats) -> dict[str, Floats]:
    """Return the reward terms φ of a step that objects are part of, each (N,).

    clear is 1 with every object more than 0.8 m away, middle to middle. hazard is 1 with one nearer
    than 0.5 m and less than 30° off the bow. camlane is 1 with the next object in the picture and
    in the car's own lane.

    Args:
        encounters: `encounters.meet`'s answers, (N, 6).
        next_sides: the side of each car's next object, (N,).
        lane: the term of that name, (N,).
    """
    own_lane = (encounters[:, NEXT_SEEN] > 0) & (next_sides * lane > 0)
    return {
        "clear": (encounters[:, DISTANCE] > CLEAR).astype(np.float64),
        "hazard": (encounters[:, HAZARDS] > 0).astype(np.float64),
        "camlane": own_lane.astype(np.float64),
    }
