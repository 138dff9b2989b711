"""Races of several laps: a car that leaves the road or crashes is put back and pays in time. SI.

The rules are those of DeepRacer's evaluations: the car goes on over the line; it is put back at
rest where it left the road, in the nearer lane, or behind an object that is near.
"""

from dataclasses import dataclass

import numpy as np

from repaint_cli.envs.racer.dynamics.bots import SIDE, lane_point
from repaint_cli.envs.racer.dynamics.directions import Rows
from repaint_cli.envs.racer.dynamics.fleet import Fleet
from repaint_cli.envs.racer.dynamics.objects import START_ROOM
from repaint_cli.envs.racer.dynamics.rules import (
    CRASHED,
    IMMOBILIZED,
    IN_PROGRESS,
    LAP_COMPLETE,
    OFF_TRACK,
    REVERSED,
)
from repaint_cli.envs.racer.track.geometry import INNER_GAP, NDIST, OUTER_GAP, Floats


@dataclass(frozen=True)
class RaceRules:
    """How long a race is, and what mishaps cost."""

    laps: int = 3
    """From the start line, at rest; the car goes on over the line."""
    off_track_penalty: float = 5.0
    """For leaving the road, and for driving backwards, s."""
    crash_penalty: float = 5.0
    """For a crash that would end an episode, s."""
    max_resets: int = 100
    """So often a car is put back; then its race is over."""
    reset_behind: float = 1.0
    """From where a car is put back to the rear of an object that is nearer than a metre, m; below 0
    it is ahead of that."""


class Race:
    """The races of N cars; the attributes are (N,) arrays that the methods change in place."""

    def __init__(self, n: int, rules: RaceRules) -> None:
        """Make N races; `start` begins them."""
        self.rules = rules
        self.laps = np.zeros(n)
        """Whole laps so far."""
        self.resets = np.zeros(n)
        """How often the car was put back."""
        self.penalties = np.zeros(n)
        """So far, s."""
        self._costs = {OFF_TRACK: rules.off_track_penalty, REVERSED: rules.off_track_penalty,
                       CRASHED: rules.crash_penalty, IMMOBILIZED: 0.0}  # fmt: skip

    def start(self, rows: Rows) -> None:
        """Begin the races of these cars (K,)."""
        for count in (self.laps, self.resets, self.penalties):
            count[rows] = 0

    def judge(self, fleet: Fleet, rows: Rows) -> None:
        """Let those of these cars (K,) that ended a lap or had a mishap go on, if they may."""
        finished = rows[fleet.status[rows] == LAP_COMPLETE]
        self.laps[finished] += 1
        going_on = finished[self.laps[finished] < self.rules.laps]
        fleet.status[going_on], fleet.progress[going_on] = IN_PROGRESS, 0.0
        for status, seconds in self._costs.items():
            stopped = rows[fleet.status[rows] == status]
            self.penalties[stopped] += seconds
            going_on = stopped[self.resets[stopped] < self.rules.max_resets]
            self.resets[going_on] += 1
            for row in going_on.tolist():
                fleet.put_back(row, *self._place(fleet, row))

    def report(self) -> dict[str, Floats]:
        """Return laps, resets and penalties so far by name, each (N,) in new arrays."""
        return {"laps": self.laps.copy(), "resets": self.resets.copy(),
                "penalties": self.penalties.copy()}  # fmt: skip

    def _place(self, fleet: Fleet, row: int) -> tuple[Floats, float]:
        """Return where a car is put back: the point, (2,), m, and the arclength, m."""
        road, measures = fleet.directions.road_of(row), fleet.measures[row]
        along = float(measures[NDIST]) * road.length
        side = 1.0 if measures[INNER_GAP] < measures[OUTER_GAP] else -1.0
        if fleet.objects is not None:
            where = fleet.objects.along[row]
            apart = np.abs(where - along)
            apart = np.minimum(apart, road.length - apart)
            half = fleet.objects.body[0] / 2
            if apart.min() < START_ROOM + half:
                nearest = apart.argmin()
                along = float(where[nearest]) - self.rules.reset_behind - half
                side = -1.0 if fleet.objects.poses[row, nearest, SIDE] > 0 else 1.0
        along %= road.length
        return np.array(lane_point(*road.lines, along, side)), along
