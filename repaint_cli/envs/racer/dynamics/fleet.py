"""N cars on one track, each alone with its bots: where they are, how they drive, how they do. SI.

Knows nothing of pictures, noise or Gymnasium. Methods take row numbers (K,), so that cars
that are parked cost nothing.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.deepracer.params import Moment, params_of
from repaint_cli.envs.racer.dynamics.bots import SIDE, Bots
from repaint_cli.envs.racer.dynamics.car import (
    BODY,
    CAR_PROFILES,
    SPEED,
    STEERING,
    STEP_SECONDS,
    YAW,
    drive_rows,
)
from repaint_cli.envs.racer.dynamics.encounters import AT_FAULT, HIT, NEXT, meet
from repaint_cli.envs.racer.dynamics.rules import (
    CRASHED,
    IN_PROGRESS,
    Counters,
    progress_since,
    reward_terms,
    status_of,
    traffic_terms,
)
from repaint_cli.envs.racer.sight.camera import lens
from repaint_cli.envs.racer.track.geometry import NDIST, WHEELS_ON, measure
from repaint_cli.envs.racer.track.track import Floats, Track

Rows = NDArray[np.int64]

OPEN_START = 0.2
"""Where the base stands at the start of an open track, so that all wheels are on it, m."""


class Fleet:
    """The states of N cars; the attributes are (N, …) arrays that the methods change in place."""

    def __init__(
        self, track: Track, n: int, car: str, max_steps: int, n_bots: int = 0, crash: str = "any"
    ) -> None:
        """Make N cars with a profile's dynamics, and their bots; `start` puts them on the road.

        Args:
            track: where they drive.
            n: N.
            car: a name in `CAR_PROFILES`.
            max_steps: time limit of an episode, steps.
            n_bots: B, bots per car.
            crash: whether "any" crash ends an episode, or only one that the car is "at-fault" in.

        Raises:
            ValueError: there are bots on an open track, where they would have nowhere to go.
        """
        if n_bots and not track.closed:
            raise ValueError(f"expected a closed track for bots, found '{track.name}', an open one")
        self.track = track
        self.bots = Bots(n, n_bots) if n_bots else None
        self._roads = (track, track.reversed())
        self._reverse = np.zeros(n, np.int64)  # which of the roads each drives
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
        self._encounters = np.zeros((n, 6))
        self._lens = lens()
        self._any_crash = crash == "any"

    def start(
        self,
        rows: Rows,
        lap_fractions: Floats,
        reverse: NDArray[np.bool_],
        rngs: Sequence[np.random.Generator],
    ) -> None:
        """Put cars at rest on the centre line, heading along it, and their bots on the road.

        Where a bot is within a metre, the car starts in the lane that the bot is not in. An open
        track is always driven from its beginning.

        Args:
            rows: which cars, (K,).
            lap_fractions: where all of them would start, in their own direction, (N,).
            reverse: who would drive the track the other way, (N,).
            rngs: everyone's own generator, which places the bots, (N,).
        """
        self._starts[rows] = lap_fractions[rows] if self.track.closed else 0.0
        if not self.track.closed:
            lap_fractions = np.full(len(lap_fractions), OPEN_START / self.track.length)
        self._reverse[rows] = reverse[rows]
        self.states[rows] = 0.0
        for road, own in self._by_road(rows):
            points, self.states[own, YAW] = road.pose_at(lap_fractions[own])
            if self.bots:
                self.bots.start(road, own, [rngs[row] for row in own])
                points = self.bots.room_for(road, own, lap_fractions[own] * road.length)
            self.states[own, :2] = points
        self._commands[rows] = 0.0
        self._counters.clear(rows)
        self.status[rows] = IN_PROGRESS
        self._measure(rows, np.zeros(len(rows)))
        self._meet(rows)

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
        if self.bots:
            for road, own in self._by_road(rows):
                self.bots.drive(road, own, STEP_SECONDS)
        crashed = self._meet(rows)
        status = status_of(
            self._measures, self._progress, self._counters, self._max_steps, crashed,
            closed=self.track.closed,
        )  # fmt: skip
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
        if self.bots:
            after = self._encounters[:, NEXT].astype(np.int64)
            sides = self.bots.poses[np.arange(len(after)), after, SIDE]
            terms |= traffic_terms(self._encounters, sides, terms["lane"])
        return {name: term * drove for name, term in terms.items()}

    @property
    def lap_fractions(self) -> Floats:
        """Where along the lap the cars are, from the start line, (N,)."""
        return self._measures[:, NDIST]

    def report(self) -> dict[str, Any]:
        """Tell where the cars are and how they do, by name, each (N,) in new arrays.

        With bots also their x, y (m) and heading (rad) as "bots", (N, B, 3), and whether the car
        touches one as "hit".
        """
        ours = {
            "x": self._fronts[:, 0].copy(),
            "y": self._fronts[:, 1].copy(),
            "heading": self.states[:, YAW].copy(),
            "speed": self.states[:, SPEED].copy(),
            "steering": self.states[:, STEERING].copy(),
            "progress": self._progress.copy(),
            "lap_time": self._counters.steps * STEP_SECONDS,
            "wheels_on": self._measures[:, WHEELS_ON].copy(),
            "waypoint": self._waypoints(),
            "status": self.status.astype(np.float64),
        }
        if self.bots is None:
            return ours
        return ours | {
            "bots": self.bots.poses[..., :SIDE].copy(), "hit": self._encounters[:, HIT].copy()
        }  # fmt: skip

    def _waypoints(self) -> Floats:
        """Return the index of each car's nearest waypoint in the direction it drives, (N,)."""
        nearest = np.empty(len(self.states))
        for road, own in self._by_road(np.arange(len(nearest))):
            nearest[own] = road.nearest_waypoint(self._measures[own, NDIST] * road.length)
        return nearest

    def params(self, row: int) -> dict[str, Any]:
        """Return what DeepRacer would tell a reward function about one car now."""
        bots = self.bots
        return params_of(
            Moment(
                road=self._roads[self._reverse[row]],
                is_reversed=bool(self._reverse[row]),
                front=self._fronts[row],
                yaw=float(self.states[row, YAW]),
                command=self._commands[row],
                measures=self._measures[row],
                progress=float(self._progress[row]),
                steps=int(self._counters.steps[row]),
                seconds=float(self._counters.steps[row] * STEP_SECONDS),
                crashed=bool(self.status[row] == CRASHED),
                poses=bots.poses[row] if bots else np.empty((0, 4)),
                bots_along=bots.along[row] if bots else np.empty(0),
                encounter=self._encounters[row],
            )
        )

    def _by_road(self, rows: Rows) -> Iterator[tuple[Track, Rows]]:
        """Yield each direction's road with those of these cars (K,) that drive it, if any."""
        for direction, road in enumerate(self._roads):
            own = rows[self._reverse[rows] == direction]
            if len(own):
                yield road, own

    def _meet(self, rows: Rows) -> NDArray[np.bool_]:
        """Find out how these cars (K,) stand to their bots; return who crashed, (N,).

        Where a crash is not the car's fault and ends nothing, its bots pause.
        """
        if self.bots is None:
            return np.zeros(len(self.states), np.bool_)
        along = self._measures[:, NDIST] * self.track.length
        meet(
            rows, self.states, along, self.track.length, self.bots.poses, self.bots.along,
            self._lens, self._encounters,
        )  # fmt: skip
        hit = self._encounters[:, HIT] > 0
        crashed = hit & (self._any_crash | (self._encounters[:, AT_FAULT] > 0))
        self.bots.pause(rows[(hit & ~crashed)[rows]])
        return crashed

    def _measure(self, rows: Rows, progress_before: Floats) -> None:
        """Find out where these cars (K,) stand on the track now."""
        for road, own in self._by_road(rows):
            measure(
                own, self.states, BODY, *road.lines, *road.outline, self._fronts, self._measures
            )
        ndist = self._measures[rows, NDIST]
        self._progress[rows] = progress_since(ndist, self._starts[rows], progress_before)
