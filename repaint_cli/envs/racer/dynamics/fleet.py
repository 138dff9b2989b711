"""N cars on their tracks, each alone with its objects: their states, dynamics and episodes. SI.

Methods take row numbers (K,), so that parked cars cost nothing.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.arguments import check_closed
from repaint_cli.envs.racer.dynamics.bots import SIDE
from repaint_cli.envs.racer.dynamics.car import (
    CAR_POINTS,
    CAR_PROFILES,
    SPEED,
    STEERING,
    STEP_SECONDS,
    YAW,
    drive_rows,
)
from repaint_cli.envs.racer.dynamics.directions import Directions, Rows, several
from repaint_cli.envs.racer.dynamics.encounters import AT_FAULT, CAR_BODY, HIT, NEXT, meet
from repaint_cli.envs.racer.dynamics.objects import Objects, ObjectSettings
from repaint_cli.envs.racer.dynamics.progress import Counters, progress_since
from repaint_cli.envs.racer.dynamics.rules import (
    IN_PROGRESS,
    reward_terms,
    status_of,
    traffic_terms,
)
from repaint_cli.envs.racer.dynamics.starts import placed
from repaint_cli.envs.racer.sight.camera import lens
from repaint_cli.envs.racer.track.geometry import NDIST, WHEELS_ON, Floats, measure
from repaint_cli.envs.racer.track.track import Track

NOTHING = ObjectSettings()
"""No bots and no boxes."""


class Fleet:
    """The states of N cars; the attributes are (N, …) arrays that the methods change in place."""

    def __init__(
        self, track: Track | Sequence[Track], n: int, car: str, max_steps: int,
        objects: ObjectSettings = NOTHING, crash: str = "any",
    ) -> None:  # fmt: skip
        """Make N cars with a profile's dynamics, and their objects; `start` puts them on the road.

        Args:
            track: where they drive, one or several; all begin on the first.
            n: N.
            car: a name in `CAR_PROFILES`.
            max_steps: time limit of an episode, steps.
            objects: B bots or boxes per car.
            crash: whether "any" crash with a bot ends an episode, or only one that the car is
                "at-fault" in; with a box every one does.

        Raises:
            ValueError: there are objects, and a track is open.
        """
        self.tracks = several(track)
        """Where they drive."""
        if objects.n:
            check_closed("boxes" if objects.boxes else "bots", self.tracks)
        self.objects = Objects(n, objects) if objects.n else None
        self.directions = Directions(self.tracks, n)
        """Which track each car drives, in which direction."""
        self.states = np.zeros((n, 5))
        """X, Y, YAW, SPEED, STEERING."""
        self.status = np.full(n, IN_PROGRESS)
        """Indices into `rules.STATUS`."""
        self.car = CAR_PROFILES[car].constants()
        """`CarProfile.constants()`, (6,)."""
        self.max_steps = max_steps
        """Time limit of an episode, steps."""
        self._commands = np.zeros((n, 2))  # of the last step
        self.fronts = np.zeros((n, 2))
        """Front points, m."""
        self.measures = np.zeros((n, 6))
        """`geometry.locate`'s answers."""
        self._starts = np.zeros(n)  # lap fractions
        self.progress = np.zeros(n)
        """Of the lap, percent."""
        self.counters = Counters.zeros(n)
        """Steps and troubles of their episodes."""
        self.encounters = np.zeros((n, 6))
        """`encounters.meet`'s answers."""
        self.any_crash = objects.boxes or crash == "any"
        """Whether every crash ends an episode."""
        self._lens = lens()

    def start(
        self,
        rows: Rows,
        lap_fractions: Floats,
        reverse: NDArray[np.bool_],
        rngs: Sequence[np.random.Generator],
        tracks: Rows | None = None,
    ) -> None:
        """Start episodes: cars at rest and along the road, their objects on it; see `placed`.

        Args:
            rows: which cars, (K,).
            lap_fractions: where cars start, in their own direction, (N,).
            reverse: whether a car drives the track the other way, (N,).
            rngs: each car's own generator, which places its objects, (N,).
            tracks: which track a car drives, (N,); the one that it drove where absent.
        """
        if tracks is not None:
            self.directions.track[rows] = tracks[rows]
        self.directions.reverse[rows] = reverse[rows]
        self.states[rows] = 0.0
        for road, own in self.directions.by_road(rows):
            self._starts[own], self.states[own, :3] = placed(
                road, own, lap_fractions, self.objects, rngs
            )
        self._commands[rows] = 0.0
        self.counters.clear(rows)
        self.status[rows] = IN_PROGRESS
        self._measure(rows, np.zeros(len(rows)))
        self._meet(rows)

    def drive(self, rows: Rows, commands: Floats) -> Floats:
        """Advance these cars (K,) by one step, and update their progress and status.

        Args:
            rows: which cars.
            commands: steering (rad) and speed (m/s) of all cars, (N, 2).

        Returns:
            the progress gained, (N,), percent; 0 for other cars.
        """
        places, before = self.states[rows, :2], self.progress[rows]
        drive_rows(rows, self.states, self._commands, commands, self.car, STEP_SECONDS)
        self._commands[rows] = commands[rows]
        self._measure(rows, before)
        gained = np.zeros(len(self.states))
        gained[rows] = self.progress[rows] - before
        moved = np.hypot(*(self.states[rows, :2] - places).T)
        self.counters.count(rows, moved, gained[rows])
        if self.objects:
            for road, own in self.directions.by_road(rows):
                self.objects.drive(road, own, STEP_SECONDS)
        crashed = self._meet(rows)
        status = status_of(self.measures, self.progress, self.counters, self.max_steps, crashed)
        self.status[rows] = status[rows]
        return gained

    def put_back(self, row: int, point: Floats, along: float) -> None:
        """Put a car at rest on a point (2,), along the road at an arclength, m; it goes on."""
        road, rows = self.directions.road_of(row), np.array([row])
        _, self.states[rows, YAW] = road.pose_at(np.array([along / road.length]))
        self.states[row, :2] = point
        self.states[row, [SPEED, STEERING]] = self._commands[row] = 0.0
        self.counters.clear_trouble(rows)
        self.status[row] = IN_PROGRESS
        self._measure(rows, self.progress[rows])
        self._meet(rows)

    def terms(self, rows: Rows, gained: Floats) -> dict[str, Any]:
        """Return the reward terms φ of a step, each (N,).

        Args:
            rows: the cars that drove, (K,); the others earn 0.
            gained: what `drive` returned, (N,), percent.
        """
        drove = np.zeros(len(self.states))
        drove[rows] = 1.0
        terms = reward_terms(self.measures, gained, self.status)
        if self.objects:
            after = self.encounters[:, NEXT].astype(np.int64)
            sides = self.objects.poses[np.arange(len(after)), after, SIDE]
            terms |= traffic_terms(self.encounters, sides, terms["lane"])
        return {name: term * drove for name, term in terms.items()}

    @property
    def lap_fractions(self) -> Floats:
        """Arclength from the start line over the track's length, (N,)."""
        return self.measures[:, NDIST]

    def report(self) -> dict[str, Any]:
        """Return the state of the cars by name, each (N,) in new arrays.

        With objects also their x, y (m) and heading (rad) as "objects", (N, B, 3), and whether the
        car touches one as "hit".
        """
        state = {
            "x": self.fronts[:, 0].copy(),
            "y": self.fronts[:, 1].copy(),
            "heading": self.states[:, YAW].copy(),
            "speed": self.states[:, SPEED].copy(),
            "steering": self.states[:, STEERING].copy(),
            "progress": self.progress.copy(),
            "lap_time": self.counters.steps * STEP_SECONDS,
            "wheels_on": self.measures[:, WHEELS_ON].copy(),
            "waypoint": self.directions.nearest_waypoints(self.lap_fractions),
            "status": self.status.astype(np.float64),
        }
        if len(self.tracks) > 1:
            state["track"] = self.directions.track.astype(np.float64)
        if self.objects is None:
            return state
        return state | {
            "objects": self.objects.poses[..., :SIDE].copy(), "hit": self.encounters[:, HIT].copy()
        }  # fmt: skip

    def _meet(self, rows: Rows) -> NDArray[np.bool_]:
        """Update the encounters of these cars (K,) with objects; return who crashed, (N,).

        Where a crash is not the car's fault and ends nothing, its bots pause.
        """
        if self.objects is None:
            return np.zeros(len(self.states), np.bool_)
        for track, own in self.directions.by_track(rows):
            length = self.tracks[track].length
            meet(
                own, self.states, self.lap_fractions * length, length, self.objects.poses,
                self.objects.along, CAR_BODY, self.objects.body, self._lens, self.encounters,
            )  # fmt: skip
        hit = self.encounters[:, HIT] > 0
        crashed = hit & (self.any_crash | (self.encounters[:, AT_FAULT] > 0))
        self.objects.pause(rows[(hit & ~crashed)[rows]])
        return crashed

    def _measure(self, rows: Rows, progress_before: Floats) -> None:
        """Update the positions on the track, and the progress, of these cars (K,)."""
        for road, own in self.directions.by_road(rows):
            measure(
                own, self.states, CAR_POINTS, *road.lines, *road.outline, self.fronts,
                self.measures,
            )  # fmt: skip
        ndist = self.measures[rows, NDIST]
        self.progress[rows] = progress_since(ndist, self._starts[rows], progress_before)
