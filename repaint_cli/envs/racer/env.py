"""N cars, each on its own copy of a track, behind Gymnasium's vector interface.

A car's observations and rewards depend on its own seed and actions alone: the number of cars and
of threads changes nothing.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from repaint_cli.envs.racer.actions import Actions, checked
from repaint_cli.envs.racer.arguments import (
    CRASHES,
    DEVICES,
    check_autoreset,
    check_closed,
    check_names,
    check_positive,
    flags_of,
    lap_fractions_of,
    tracks_of,
)
from repaint_cli.envs.racer.deepracer.params import params_in
from repaint_cli.envs.racer.device.card import cars_on_gpu, check_on_cpu
from repaint_cli.envs.racer.dynamics.car import ACTIONS, CAR_PROFILES, STEP_SECONDS
from repaint_cli.envs.racer.dynamics.commands import commands_for
from repaint_cli.envs.racer.dynamics.directions import Rows, TrackSchedule, several
from repaint_cli.envs.racer.dynamics.fleet import NOTHING, Fleet
from repaint_cli.envs.racer.dynamics.objects import ObjectSettings
from repaint_cli.envs.racer.dynamics.race import Race, RaceRules
from repaint_cli.envs.racer.dynamics.rules import IN_PROGRESS, TIME_UP
from repaint_cli.envs.racer.dynamics.starts import drawn_fractions
from repaint_cli.envs.racer.sight.appearance import RandomAppearance
from repaint_cli.envs.racer.sight.noise import Noise, disturb_command
from repaint_cli.envs.racer.sight.sensors import SENSORS, Readings, Sensors
from repaint_cli.envs.racer.track.geometry import Floats
from repaint_cli.envs.racer.track.track import Track
from repaint_cli.envs.seeds import seeds_of

Flags = NDArray[np.bool_]
Infos = dict[str, Any]


class RacerVectorEnv(VectorEnv[Any, NDArray[Any], Any]):
    """Drive a lap by camera: ten actions, 15 steps a second, one car an environment.

    **Observation** Box(0, 255, (120, 160, 1), uint8): the grey picture of a camera on the car; with
    two cameras a channel each, left and right; with a lidar Dict(camera, lidar), 64 ranges in m
    over 300° behind the car.

    **Actions** Discrete(A), by default 10: steering −30, −15, 0, 15, 30° at 0.5 m/s, then 1.0 m/s.
    With ranges Box(−1, 1, (2,), float32): steering and speed, −1 and 1 are the ends of the ranges.

    **Reward** the progress of the step, in laps (`dprog`); tasks weigh the terms in the infos.

    **Start** at rest on the centre line, at one of 20 places drawn by the environment's own
    generator, or where `reset(options={"lap_fraction": ...})` says; an open track has one place.

    **Tracks** of several, each episode drives one, drawn by the environment's own generator, or
    where `reset(options={"track": ...})` names the first, all in turn.

    **Objects** are bots that drive the same road in its lanes, or boxes that stand there.

    **End** by leaving the track with all wheels, crashing, completing the lap, standing
    still or driving backwards for 15 steps; truncated after `max_steps`.

    **Infos** arrays (N,) float64, the same keys at every step. Reward terms: `lane`, `keep`,
    `dprog`, `fail`, and with objects `clear`, `hazard`, `camlane`. State: `x`, `y` (front point,
    m), `heading` (rad), `speed` (true, m/s), `steering` (true, rad), `progress` (%), `lap_time`
    (s), `wheels_on` (the road, 0 to 4), `waypoint` (index of the nearest) and `status`, an index
    into `rules.STATUS`; with objects `objects`, (N, B, 3): x, y and heading of each, and `hit`; in
    a race `laps`, `resets` and `penalties` (s); of several tracks `track`, its number. Progress is
    that of the front point, so it begins a little above 0.

    **Autoreset** NEXT_STEP starts a new episode in the step after the last, ignoring that action.
    DISABLED parks the car: it keeps state and image, earns and costs nothing.
    """

    def __init__(
        self, track: Track | Sequence[Track], num_envs: int, *, car: str = "sim4",
        actions: Actions | Mapping[str, Sequence[float]] = ACTIONS, sensors: str = "camera",
        objects: ObjectSettings = NOTHING, crash: str = "at-fault", range_min: float = 0.12,
        max_steps: int = 1500, noise: Noise | None = None,
        appearance: RandomAppearance | None = None, race: RaceRules | None = None,
        autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP, threads: int = 1,
        device: str = "cpu",
    ) -> None:  # fmt: skip
        """Build N cars on a track, or on several; `reset` puts them on the road.

        Args:
            track: see above.
            num_envs: N.
            car: a name in `CAR_PROFILES`.
            actions: what to choose from, steering (degrees, left is positive) and speed (m/s), or
                the ranges {"steering_angle": (low, high), "speed": (low, high)}.
            sensors: one of `SENSORS`.
            objects: bots or boxes on each track.
            crash: whether "any" crash ends an episode, or only one the car is "at-fault" in.
            range_min: what the lidar reads of anything nearer, m.
            max_steps: time limit of an episode, steps of 1/15 s.
            noise: disturbances of actions and images, or None.
            appearance: what of the images is drawn anew for each episode, or None.
            race: rules under which an episode is a race of several laps, or None: it is a lap.
            autoreset_mode: NEXT_STEP or DISABLED.
            threads: that draw images.
            device: one of `DEVICES`; with "cuda" arrays are those on a GPU of `on_device`.

        Raises:
            ValueError: an argument is out of range; other errors are those of `cars_on_gpu`.
        """
        self._commands = commands_for(checked(actions))
        check_positive(num_envs=num_envs, max_steps=max_steps, threads=threads)
        check_names(car=(car, CAR_PROFILES), sensors=(sensors, SENSORS))
        check_names(crash=(crash, CRASHES), device=(device, DEVICES))
        check_autoreset(autoreset_mode)
        self.num_envs, self.tracks = num_envs, several(track)
        check_closed("races", self.tracks if race else ())
        self.metadata = {"autoreset_mode": autoreset_mode, "render_fps": round(1 / STEP_SECONDS)}
        self._parks = autoreset_mode is AutoresetMode.DISABLED
        self._sensors = Sensors(track, sensors, range_min, noise, threads, appearance)
        spaces = self._sensors.space(), self._commands.space
        self.single_observation_space, self.single_action_space = spaces
        self.observation_space, self.action_space = (batch_space(s, num_envs) for s in spaces)
        self._fleet = Fleet(track, num_envs, car, max_steps, objects, crash)
        self._race = Race(num_envs, race) if race else None
        self._chosen = np.zeros((num_envs, 2))  # the commands of the last step
        self._noise, self._is_reset = noise, False
        self._rngs = [np.random.default_rng() for _ in range(num_envs)]
        self._given_starts: Floats | None = None
        self._schedule = TrackSchedule(len(self.tracks), num_envs)
        self._reverse = np.zeros(num_envs, np.bool_)
        self._parked_readings: Readings = {}  # the last ones of parked cars
        parts = self._fleet, self._sensors, self._commands, self._parks, self._race
        self.on_device = None if device == "cpu" else cars_on_gpu(*parts)
        """The cars on a GPU, see `device.racer.DeviceRacer`, or None."""

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, Infos]:
        """Start an episode in every environment.

        Args:
            seed: one an environment; an integer s stands for s, s + 1, …; None goes on with the
                generators as they are.
            options: "lap_fraction", (N,), is where cars start, now and at autoresets; without it
                they draw their places. "track", (N,), is which of several tracks cars drive first,
                and at autoresets the next one. "reverse", (N,), is whether a car drives the other
                way; "parked", (N,), whether it has no episode, where cars park after theirs.

        Raises:
            ValueError: the seeds, fractions or tracks are not N, or there is no such track.
        """
        for i, one in enumerate(seeds_of(seed, self.num_envs)):
            if one is not None:
                self._rngs[i] = np.random.default_rng(one)
        self._given_starts = lap_fractions_of(options, self.num_envs)
        self._schedule.begin(tracks_of(options, self.num_envs, len(self.tracks)))
        self._reverse = flags_of(options, "reverse", self.num_envs)
        parked = flags_of(options, "parked", self.num_envs)
        self._is_reset = True
        if self.on_device is not None:
            return self.on_device.reset(self._rngs, self._given_starts, self._reverse, parked)
        rows = np.arange(self.num_envs)
        self._start(rows)
        self._fleet.status[parked] = TIME_UP
        readings = self._sensors.read(rows, self._fleet, self._rngs)
        if self._parks:
            self._parked_readings = {name: part.copy() for name, part in readings.items()}
        return self._observation(readings), self._infos(rows[:0], np.zeros(self.num_envs))

    def step(self, actions: NDArray[Any]) -> tuple[Any, Floats, Flags, Flags, Infos]:
        """Drive every car for 1/15 s.

        Args:
            actions: which of them, (N,), or in their ranges, (N, 2); ignored for cars that are
                parked or due for a reset.

        Returns:
            observations (N, …), rewards, terminations, truncations (N,), infos: all new arrays.

        Raises:
            ResetNeeded: the environment was never reset.
            ValueError: the actions are not N of the action space.
        """
        if not self._is_reset:
            raise ResetNeeded("expected reset() before the first step()")
        if self.on_device is not None:
            return self.on_device.step(actions)
        commands = self._commands.of(self._commands.checked(actions, self.num_envs))
        running = self._fleet.status == IN_PROGRESS
        moving, ended = np.flatnonzero(running), np.flatnonzero(~running)
        if not self._parks:
            self._start(ended)
        self._chosen[moving] = commands[moving]
        if self._noise is not None:
            for row in moving:
                commands[row] = disturb_command(commands[row], self._noise, self._rngs[row])
        infos = self._infos(moving, self._fleet.drive(moving, commands))
        ending = running & (self._fleet.status != IN_PROGRESS)
        sensing = moving if self._parks else np.arange(self.num_envs)
        readings = self._sensors.read(sensing, self._fleet, self._rngs)
        for name, parked in self._parked_readings.items():
            readings[name][ended] = parked[ended]
            parked[ending] = readings[name][ending]
        truncations = ending & (self._fleet.status == TIME_UP)
        terminations = ending & ~truncations
        return self._observation(readings), infos["dprog"].copy(), terminations, truncations, infos

    def params(self, row: int) -> dict[str, Any]:
        """Return DeepRacer's `params` of one car's state; CardError: the cars are on a GPU.

        Speed and steering in it are those of the action that was chosen, whatever noise made of it.
        """
        check_on_cpu("params, for reward functions", self.on_device)
        return params_in(self._fleet, row, self._chosen[row])

    def close_extras(self, **kwargs: Any) -> None:
        """Stop the sensors' threads."""
        self._sensors.close()

    def _start(self, rows: Rows) -> None:
        """Begin new episodes of these cars (K,)."""
        fractions = self._given_starts
        if fractions is None:
            fractions = drawn_fractions(rows, self._rngs)
        self._chosen[rows] = 0.0
        tracks = self._schedule.take(rows, self._rngs)
        self._fleet.start(rows, fractions, self._reverse, self._rngs, tracks)
        self._sensors.start(rows, self._rngs)
        if self._race:
            self._race.start(rows)

    def _infos(self, moving: Rows, gained: Floats) -> Infos:
        infos = self._fleet.terms(moving, gained) | self._fleet.report()
        if self._race:
            self._race.judge(self._fleet, moving)
            infos |= self._race.report()
        return infos

    def _observation(self, readings: Readings) -> Any:
        """Return readings in the form of the observation space."""
        return {**readings} if "lidar" in readings else readings["camera"]
