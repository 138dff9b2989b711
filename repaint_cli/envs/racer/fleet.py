"""N cars on one track, each alone: where they are, how they drive, how they do. SI units.

Knows nothing of cameras, seeds, noise or Gymnasium. Methods take row numbers (K,), so that cars
that are parked cost nothing.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.car import (
    BODY,
    CAR_PROFILES,
    SPEED,
    STEERING,
    STEP_SECONDS,
    YAW,
    drive_rows,
)
from repaint_cli.envs.racer.geometry import NDIST, measure
from repaint_cli.envs.racer.rules import (
    IN_PROGRESS,
    Counters,
    progress_since,
    reward_terms,
    status_of,
)
from repaint_cli.envs.racer.track import Floats, Track

Rows = NDArray[np.int64]


class Fleet:
    """The states of N cars; the attributes are (N, …) arrays that the methods change in place."""

    def __init__(self, track: Track, n: int, car: str, max_steps: int) -> None:
        """Make N cars with the dynamics of a profile; `start` puts them on the road."""
        self.track = track
        self.states = np.zeros((n, 5))
        """X, Y, YAW, SPEED, STEERING."""
        self.status = np.full(n, IN_PROGRESS)
        """Indices into `rules.STATUS`."""
        self._car = CAR_PROFILES[car].constants()
        self._max_steps = max_steps
        self._commands = np.zeros((n, 2))  # of the last step
        self._fronts = np.zeros((n, 2))
        self._measures = np.zeros((n, 6))
        self._starts = np.zeros(n)  # lap fractions
        self._progress = np.zeros(n)  # percent
        self._counters = Counters.zeros(n)

    def start(self, rows: Rows, lap_fractions: Floats) -> None:
        """Put these cars (K,) at rest on the centre line at these places (K,), heading along it."""
        self._starts[rows] = lap_fractions
        points, headings = self.track.pose_at(lap_fractions)
        self.states[rows] = 0.0
        self.states[rows, :2] = points
        self.states[rows, YAW] = headings
        self._commands[rows] = 0.0
        self._counters.clear(rows)
        self.status[rows] = IN_PROGRESS
        self._measure(rows, np.zeros(len(rows)))

    def drive(self, rows: Rows, commands: Floats) -> Floats:
        """Advance these cars (K,) by one step and judge them.

        Args:
            rows: which cars.
            commands: steering (rad) and speed (m/s) of all cars, (N, 2).

        Returns:
            every car's gain of progress, (N,), percent; 0 for the others.
        """
        places, before = self.states[rows, :2], self._progress[rows]
        drive_rows(rows, self.states, self._commands, commands, self._car, STEP_SECONDS)
        self._commands[rows] = commands[rows]
        self._measure(rows, before)
        gained = np.zeros(len(self.states))
        gained[rows] = self._progress[rows] - before
        moved = np.hypot(*(self.states[rows, :2] - places).T)
        self._counters.count(rows, moved, gained[rows])
        status = status_of(self._measures, self._progress, self._counters, self._max_steps)
        self.status[rows] = status[rows]
        return gained

    def terms(self, rows: Rows, gained: Floats) -> dict[str, Any]:
        """Return the reward terms φ of a step, each (N,).

        Args:
            rows: the cars that drove, (K,); the others earn 0.
            gained: what `drive` returned, (N,), percent.
        """
        drove = np.zeros(len(self.states))
        drove[rows] = 1.0
        terms = reward_terms(self._measures, gained, self.status)
        return {name: term * drove for name, term in terms.items()}

    def report(self) -> dict[str, Any]:
        """Tell where the cars are and how they do, by name, each (N,) in new arrays."""
        return {
            "x": self._fronts[:, 0].copy(),
            "y": self._fronts[:, 1].copy(),
            "heading": self.states[:, YAW].copy(),
            "speed": self.states[:, SPEED].copy(),
            "steering": self.states[:, STEERING].copy(),
            "progress": self._progress.copy(),
            "lap_time": self._counters.steps * STEP_SECONDS,
            "status": self.status.astype(np.float64),
        }

    def _measure(self, rows: Rows, progress_before: Floats) -> None:
        """Find out where these cars (K,) stand on the track now."""
        track = self.track
        road = (track.centre, track.distances, track.inner, track.outer)
        measure(rows, self.states, BODY, *road, self._fronts, self._measures)
        ndist = self._measures[rows, NDIST]
        self._progress[rows] = progress_since(ndist, self._starts[rows], progress_before)
