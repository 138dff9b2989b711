"""N cars on a GPU, with the arrays of `dynamics.fleet.Fleet` there: bots drive there, too. SI.

**N** cars, **B** bots or boxes, **F** reward terms, **R** records.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.device import launch_cars
from repaint_cli.envs.racer.device.arrays import launch_each, upload, zeros
from repaint_cli.envs.racer.device.starts import Starts
from repaint_cli.envs.racer.dynamics.bots import SIDE
from repaint_cli.envs.racer.dynamics.car import CAR_POINTS
from repaint_cli.envs.racer.dynamics.commands import Commands, ListedCommands
from repaint_cli.envs.racer.dynamics.encounters import CAR_BODY, HIT
from repaint_cli.envs.racer.dynamics.fleet import NOTHING, Fleet
from repaint_cli.envs.racer.dynamics.objects import WAITS
from repaint_cli.envs.racer.dynamics.rules import IN_PROGRESS, TERMS, TIME_UP, TRAFFIC_TERMS
from repaint_cli.envs.racer.names import RECORDS
from repaint_cli.envs.racer.sight.camera import lens
from repaint_cli.envs.racer.track.geometry import Floats


class DeviceFleet:
    """The states of N cars; attributes are arrays on the GPU that each step changes in place."""

    def __init__(self, like: Fleet, commands: Commands) -> None:
        """Make cars with the settings of a fleet on the CPU, whose actions mean these commands."""
        road, n = like.tracks[0], len(like.states)
        roads = road, road.reversed()
        self.n, self.length, self.objects = n, road.length, like.objects
        settings = like.objects.settings if like.objects else NOTHING
        self.starts = Starts(roads, n, settings)
        pairs = zip(*((*way.lines, *way.outline) for way in roads), strict=True)
        self._road = tuple(upload(np.stack(pair)) for pair in pairs)
        self._waypoints = upload(np.stack([way.waypoints[1] for way in roads]))
        self._car, self._points = upload(like.car), upload(CAR_POINTS)
        self._own, self._lens = upload(CAR_BODY), upload(lens())
        self._listed = isinstance(commands, ListedCommands)
        self._choices = (
            (upload(commands.examples),) if isinstance(commands, ListedCommands)
            else (upload(commands.low), upload(commands.high))
        )  # fmt: skip
        self._max_steps, self._any_crash = like.max_steps, bool(like.any_crash)
        self._make_cars(n)
        self._make_objects(n if like.objects else 0, settings.n)
        self.body = upload(settings.body)
        """Length and width of an object for crashes, (2,), m."""
        names = TERMS + TRAFFIC_TERMS * bool(settings.n)
        self._all_terms, self._all_records = zeros((len(names), n)), zeros((len(RECORDS), n))
        terms = {name: self._all_terms[k] for k, name in enumerate(names)}
        records = {name: self._all_records[k] for k, name in enumerate(RECORDS)}
        self.infos: dict[str, Any] = terms | records
        """Reward terms and records by name, (N,), with objects these (N, B, 3) and `hit`; and as
        one array `terms`, (F, N), and `records`, (R, N), in the order of their names."""
        if like.objects:
            self.infos |= {"objects": self.poses[:, :, :SIDE], "hit": self.encounters[:, HIT]}
        self.infos["terms"], self.infos["records"] = self._all_terms, self._all_records

    def _make_cars(self, n: int) -> None:
        self.states, self.before, self.commands = zeros((n, 5)), zeros((n, 2)), zeros((n, 2))
        self.fronts, self.measures = zeros((n, 2)), zeros((n, 6))
        self.status, self.ways, self.did = (zeros((n,), np.int64) for _ in range(3))
        self.counters, self.readings = zeros((n, 3), np.int64), zeros((n,), np.int64)
        self.progress, self.gained, self.first = zeros((n,)), zeros((n,)), zeros((n,))
        self.rewards = zeros((n,))
        """Progress of the step, laps, (N,)."""
        self.terminations, self.truncations = zeros((n,), np.bool_), zeros((n,), np.bool_)
        self.crashed = zeros((n,), np.bool_)

    def _make_objects(self, n: int, n_objects: int) -> None:
        self.poses, self.encounters = zeros((n, n_objects, 4)), zeros((n, 6))
        self.along, self.goal_sides, self.changed, self.waiting = (
            zeros((n, n_objects)) for _ in range(4)
        )
        self.waits, self.paused = zeros((n, n_objects, WAITS)), zeros((n,))
        self.n_changes = zeros((n, n_objects), np.int64)

    def begin(
        self, rngs: Sequence[np.random.Generator], fractions: Floats | None,
        reverse: NDArray[np.bool_], parked: NDArray[np.bool_], stream: Any,
    ) -> None:  # fmt: skip
        """Start an episode of every car; those that are parked, (N,), end it at once.

        See `Starts.begin` for the other arguments.
        """
        self.starts.begin(rngs, fractions, reverse, stream)
        self.ways.copy_to_device(reverse.astype(np.int64), stream)
        self.status.copy_to_device(np.full(self.n, TIME_UP, np.int64), stream)
        self.readings.copy_to_device(np.zeros(self.n, np.int64), stream)
        self._advance(False, stream)
        if parked.any():
            status = np.where(parked, TIME_UP, IN_PROGRESS)
            self.status.copy_to_device(status, stream)
            self._report(stream)

    def step(self, actions: Any, parks: bool, stream: Any) -> None:
        """Drive every car for a step; those whose episode is over park, or begin the next.

        Args:
            actions: which of the list, (N,), or within the ranges, (N, 2), on the GPU.
            parks: whether they park.
            stream: on which all of it happens.
        """
        choose = launch_cars.choose_listed if self._listed else launch_cars.choose_ranged
        launch_each(choose, self.n, stream, actions, *self._choices, self.commands)
        self.starts.tick(stream)
        self._advance(parks, stream)

    def _advance(self, parks: bool, stream: Any) -> None:
        starts, objects = self.starts, self.objects
        launch_each(
            launch_cars.drive_cars, self.n, stream, parks, starts.places, starts.begun,
            self.readings, self._road, self.ways, self._car, self._points, self.status, self.did,
            self.commands, self.before, self.states, self.fronts, self.measures, self.first,
            self.progress, self.gained, self.counters,
        )  # fmt: skip
        if objects is not None:
            launch_each(
                launch_cars.drive_objects, self.n, stream, objects.speed,
                objects.settings.change_length, starts.objects, starts.begun, self._road,
                self.ways, self.did, self.along, self.goal_sides, self.changed, self.waits,
                self.waiting, self.n_changes, self.paused, self.poses,
            )  # fmt: skip
            launch_each(
                launch_cars.meet_objects, self.n, stream, self.length, self._any_crash, self._own,
                self.body, self._lens, self.did, self.states, self.measures, self.poses,
                self.along, self.encounters, self.paused, self.crashed,
            )  # fmt: skip
        launch_each(
            launch_cars.judge_cars, self.n, stream, self._max_steps,
            objects.settings.n if objects else 0, self.did, self.measures, self.progress,
            self.gained, self.counters, self.crashed, self.encounters, self.poses, self.status,
            self.rewards, self.terminations, self.truncations, self._all_terms,
        )  # fmt: skip
        self._report(stream)

    def _report(self, stream: Any) -> None:
        launch_each(
            launch_cars.report_cars, self.n, stream, self.length, self._waypoints, self.ways,
            self.states, self.fronts, self.measures, self.progress, self.counters, self.status,
            self._all_records,
        )  # fmt: skip
