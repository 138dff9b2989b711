"""N cars, each on its own copy of one track, behind Gymnasium's vector interface.

Every number a car meets comes from its own seed and its own actions: the cars beside it, and the
number of threads, change nothing.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Dict, Discrete
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from repaint_cli.envs.racer.dynamics.car import ACTIONS, CAR_PROFILES, STEP_SECONDS, commands_of
from repaint_cli.envs.racer.dynamics.fleet import Fleet, Rows
from repaint_cli.envs.racer.dynamics.rules import IN_PROGRESS, TIME_UP
from repaint_cli.envs.racer.sight.noise import Noise, disturb_command
from repaint_cli.envs.racer.sight.sensors import SENSORS, Sensors, Sights
from repaint_cli.envs.racer.track.track import Floats, Track

START_PLACES = 20
"""Evenly spaced places on the lap, of which each episode draws its start."""

CRASHES = ("at-fault", "any")
"""Which crashes end an episode."""

Flags = NDArray[np.bool_]
Infos = dict[str, Any]


class RacerVectorEnv(VectorEnv[Any, NDArray[np.int64], Any]):
    """Drive a lap by camera: ten actions, 15 steps a second, one car an environment.

    **Observation** Box(0, 255, (120, 160, 1), uint8): the grey picture of a camera on the car; with
    two cameras a channel each, left and right; with a lidar Dict(camera, lidar), 64 ranges in m
    over 300° behind the car.

    **Actions** Discrete(A), by default 10: steering −30, −15, 0, 15, 30° at 0.5 m/s, then 1.0 m/s.

    **Reward** the progress of the step, in laps (`dprog`); tasks weigh the terms in the infos.

    **Start** at rest on the centre line, at one of 20 places drawn by the environment's own
    generator, or where `reset(options={"lap_fraction": ...})` says; on an open track always at its
    beginning.

    **Bots** drive the same road in its lanes, placed anew in every episode.

    **End** by leaving the track with all wheels, crashing into a bot, completing the lap, standing
    still or driving backwards for 15 steps; truncated after `max_steps`.

    **Infos** arrays (N,) float64, the same keys at every step. Reward terms: `lane`, `keep`,
    `dprog`, `fail`, and with bots `clear`, `hazard`, `camlane`. State: `x`, `y` (front point, m),
    `heading` (rad), `speed` (true, m/s), `steering` (true, rad), `progress` (%), `lap_time` (s),
    `wheels_on` (the road, 0 to 4), `waypoint` (index of the nearest) and `status`, an index into
    `rules.STATUS`; with bots `bots`, (N, B, 3): x, y and heading of each, and `hit`.
    Progress is that of the front point, so it begins a little above 0.

    **Autoreset** NEXT_STEP starts a new episode in the step after the last, ignoring that action.
    DISABLED parks the car: it keeps its state and last image, earns nothing and costs nothing.
    """

    def __init__(
        self,
        track: Track,
        num_envs: int,
        *,
        car: str = "sim4",
        actions: Sequence[tuple[float, float]] = ACTIONS,
        sensors: str = "camera",
        n_bots: int = 0,
        crash: str = "at-fault",
        range_min: float = 0.12,
        max_steps: int = 1500,
        noise: Noise | None = None,
        autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP,
        threads: int = 1,
    ) -> None:
        """Build N cars on a track; `reset` puts them on the road.

        Args:
            track: where they drive.
            num_envs: N.
            car: a name in `CAR_PROFILES`.
            actions: what to choose from, steering (degrees, left is positive) and speed (m/s).
            sensors: one of `SENSORS`.
            n_bots: other cars on each track.
            crash: whether "any" crash ends an episode, or only one the car is "at-fault" in.
            range_min: what the lidar reads of anything nearer, m.
            max_steps: time limit of an episode, steps of 1/15 s.
            noise: disturbances of actions and images, or None.
            autoreset_mode: NEXT_STEP or DISABLED.
            threads: how many share the drawing.

        Raises:
            ValueError: an argument is out of range.
        """
        _check_numbers(num_envs=num_envs, max_steps=max_steps, threads=threads)
        _check_names(car=(car, CAR_PROFILES), sensors=(sensors, SENSORS), crash=(crash, CRASHES))
        if autoreset_mode not in (AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED):
            raise ValueError(f"expected autoreset NEXT_STEP or DISABLED, found {autoreset_mode}")
        self.metadata = {"autoreset_mode": autoreset_mode, "render_fps": round(1 / STEP_SECONDS)}
        self.num_envs = num_envs
        self._sensors = Sensors(track, sensors, range_min, noise, threads)
        self.single_observation_space = self._sensors.space()
        self._actions = commands_of(actions)
        self.single_action_space = Discrete(len(self._actions))
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.track = track
        self._fleet = Fleet(track, num_envs, car, max_steps, n_bots, crash)
        self._noise = noise
        self._rngs = [np.random.default_rng() for _ in range(num_envs)]
        self._given_starts: Floats | None = None
        self._reverse = np.zeros(num_envs, np.bool_)
        self._is_reset = False
        self._parks = autoreset_mode is AutoresetMode.DISABLED
        self._parked: Sights = {}  # what the parked cars saw last

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
            options: "lap_fraction", (N,), places the cars there, now and at autoresets; absent,
                they draw their places. "reverse", (N,), says who drives the other way.

        Raises:
            ValueError: the seeds or fractions are not N.
        """
        self._seed(seed)
        self._given_starts = _lap_fractions(options, self.num_envs)
        self._reverse = np.zeros(self.num_envs, np.bool_)
        if options and "reverse" in options:
            self._reverse[:] = options["reverse"]
        self._is_reset = True
        rows = np.arange(self.num_envs)
        self._start(rows)
        seen = self._sensors.look(rows, self._fleet, self._rngs)
        self._parked = {name: part.copy() for name, part in seen.items() if self._parks}
        return self._observation(seen), self._infos(rows[:0], np.zeros(self.num_envs))

    def step(self, actions: NDArray[np.int64]) -> tuple[Any, Floats, Flags, Flags, Infos]:
        """Drive every car for 1/15 s.

        Args:
            actions: which of them, (N,); ignored for cars that are parked or due for a reset.

        Returns:
            observations (N, …), rewards (N,), terminations (N,), truncations (N,), infos; all of
            them new arrays.

        Raises:
            ResetNeeded: there was no reset yet.
            ValueError: the actions are not N integers from 0 to A − 1.
        """
        if not self._is_reset:
            raise ResetNeeded("expected reset() before the first step()")
        commands = self._actions[_checked(actions, self.num_envs, len(self._actions))]
        running = self._fleet.status == IN_PROGRESS
        moving, ended = np.flatnonzero(running), np.flatnonzero(~running)
        if not self._parks:
            self._start(ended)
        if self._noise is not None:
            for row in moving:
                commands[row] = disturb_command(commands[row], self._noise, self._rngs[row])
        infos = self._infos(moving, self._fleet.drive(moving, commands))
        over = running & (self._fleet.status != IN_PROGRESS)
        looking = moving if self._parks else np.arange(self.num_envs)
        seen = self._sensors.look(looking, self._fleet, self._rngs)
        for name, parked in self._parked.items():
            seen[name][ended] = parked[ended]
            parked[over] = seen[name][over]
        truncations = over & (self._fleet.status == TIME_UP)
        terminations = over & ~truncations
        return self._observation(seen), infos["dprog"].copy(), terminations, truncations, infos

    def params(self, row: int) -> dict[str, Any]:
        """Return what DeepRacer would tell a reward function about one car now: its `params`."""
        return self._fleet.params(row)

    def close_extras(self, **kwargs: Any) -> None:
        """Let the threads go."""
        self._sensors.close()

    def _seed(self, seed: int | Sequence[int | None] | None) -> None:
        """Renew the generators that are given a seed."""
        if seed is None:
            return
        n = self.num_envs
        if isinstance(seed, (int, np.integer)):
            seed = [int(seed) + i for i in range(n)]
        if len(seed) != n:
            raise ValueError(f"expected {n} seeds, found {len(seed)}")
        for i, one in enumerate(seed):
            if one is not None:
                self._rngs[i] = np.random.default_rng(one)

    def _start(self, rows: Rows) -> None:
        """Begin new episodes of these cars (K,)."""
        if self._given_starts is not None:
            places = self._given_starts
        else:
            places = np.zeros(self.num_envs)
            for row in rows:
                places[row] = self._rngs[row].integers(START_PLACES) / START_PLACES
        self._fleet.start(rows, places, self._reverse, self._rngs)

    def _infos(self, moving: Rows, gained: Floats) -> Infos:
        return self._fleet.terms(moving, gained) | self._fleet.report()

    def _observation(self, seen: Sights) -> Any:
        """Return what was seen as the observation space has it."""
        return {**seen} if isinstance(self.single_observation_space, Dict) else seen["camera"]


def _check_numbers(**numbers: int) -> None:
    for name, value in numbers.items():
        if value < 1:
            raise ValueError(f"expected {name} of at least 1, found {value}")


def _check_names(**names: tuple[str, Iterable[str]]) -> None:
    for what, (name, known) in names.items():
        if name not in known:
            raise ValueError(f"unknown {what} '{name}'; choose one of {', '.join(known)}")


def _checked(actions: NDArray[np.int64], n: int, n_actions: int) -> NDArray[np.int64]:
    actions = np.asarray(actions)
    if actions.shape != (n,) or actions.dtype.kind not in "iu":
        raise ValueError(
            f"expected {n} integer actions, found shape {actions.shape} of {actions.dtype}"
        )
    if actions.min() < 0 or actions.max() >= n_actions:
        raise ValueError(f"expected actions from 0 to {n_actions - 1}, found {actions}")
    return actions


def _lap_fractions(options: dict[str, Any] | None, n: int) -> Floats | None:
    if options is None or "lap_fraction" not in options:
        return None
    fractions = np.array(options["lap_fraction"], dtype=np.float64)
    if fractions.shape != (n,) or not np.isfinite(fractions).all():
        raise ValueError(f"expected {n} finite lap fractions, found {fractions}")
    return np.mod(fractions, 1.0)
