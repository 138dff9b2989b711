"""N cars, each alone on its own copy of one track, behind Gymnasium's vector interface.

Every number a car meets comes from its own seed and its own actions: the cars beside it, and the
number of threads, change nothing.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box, Discrete
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from repaint_cli.envs.racer.camera import HEIGHT, WALLS, WIDTH, render_rows, row_table
from repaint_cli.envs.racer.car import ACTIONS, CAR_PROFILES, STEP_SECONDS
from repaint_cli.envs.racer.fleet import Fleet, Rows
from repaint_cli.envs.racer.ground import ground_of
from repaint_cli.envs.racer.noise import Noise, disturb_command, disturb_image
from repaint_cli.envs.racer.rules import IN_PROGRESS, TIME_UP
from repaint_cli.envs.racer.track import Floats, Track

START_PLACES = 20
"""Evenly spaced places on the lap, of which each episode draws its start."""

Images = NDArray[np.uint8]
Flags = NDArray[np.bool_]
Infos = dict[str, Any]


class RacerVectorEnv(VectorEnv[Images, NDArray[np.int64], Any]):
    """Drive a lap by camera: ten actions, 15 steps a second, one car an environment.

    **Observation** Box(0, 255, (120, 160, 1), uint8): the grey picture of a camera on the car.

    **Actions** Discrete(10): steering −30, −15, 0, 15, 30° at 0.5 m/s, then the same at 1.0 m/s.

    **Reward** the progress of the step, in laps (`dprog`); tasks weigh the terms in the infos.

    **Start** at rest on the centre line, at one of 20 places drawn by the environment's own
    generator, or where `reset(options={"lap_fraction": ...})` says.

    **End** by leaving the track with all wheels, completing the lap, standing still or driving
    backwards for 15 steps; truncated after `max_steps`.

    **Infos** arrays (N,) float64, the same keys at every step. Reward terms: `lane`, `keep`,
    `dprog`, `fail`. State: `x`, `y` (front point, m), `heading` (rad), `speed` (true, m/s),
    `steering` (true, rad), `progress` (%), `lap_time` (s) and `status`, an index into
    `rules.STATUS`. Progress is that of the front point, so it begins a little above 0.

    **Autoreset** NEXT_STEP starts a new episode in the step after the last, ignoring that action.
    DISABLED parks the car: it keeps its state and last image, earns nothing and costs nothing.
    """

    def __init__(
        self,
        track: Track,
        num_envs: int,
        *,
        car: str = "sim4",
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
            max_steps: time limit of an episode, steps of 1/15 s.
            noise: disturbances of actions and images, or None.
            autoreset_mode: NEXT_STEP or DISABLED.
            threads: how many share the drawing.

        Raises:
            ValueError: an argument is out of range.
        """
        _check_arguments(num_envs, car, max_steps, autoreset_mode, threads)
        self.metadata = {"autoreset_mode": autoreset_mode, "render_fps": round(1 / STEP_SECONDS)}
        self.num_envs = num_envs
        self.single_observation_space = Box(0, 255, (HEIGHT, WIDTH, 1), np.uint8)
        self.single_action_space = Discrete(len(ACTIONS))
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.track = track
        self._fleet = Fleet(track, num_envs, car, max_steps)
        self._ground = ground_of(track)
        self._row_table = row_table()
        self._noise = noise
        self._rngs = [np.random.default_rng() for _ in range(num_envs)]
        self._given_starts: Floats | None = None
        self._is_reset = False
        self._parks = autoreset_mode is AutoresetMode.DISABLED
        self._parked_images = np.zeros((num_envs if self._parks else 0, HEIGHT, WIDTH, 1), np.uint8)
        self._threads = threads
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Images, Infos]:
        """Start an episode in every environment.

        Args:
            seed: one an environment; an integer s stands for s, s + 1, …; None goes on with the
                generators as they are.
            options: "lap_fraction", (N,), places the cars there, now and at autoresets; absent,
                they draw their places.

        Raises:
            ValueError: the seeds or fractions are not N.
        """
        self._seed(seed)
        self._given_starts = _lap_fractions(options, self.num_envs)
        self._is_reset = True
        rows = np.arange(self.num_envs)
        self._start(rows)
        return self._images(rows), self._infos(rows[:0], np.zeros(self.num_envs))

    def step(self, actions: NDArray[np.int64]) -> tuple[Images, Floats, Flags, Flags, Infos]:
        """Drive every car for 1/15 s.

        Args:
            actions: rows of `ACTIONS`, (N,); ignored for cars that are parked or due for a reset.

        Returns:
            images (N, 120, 160, 1), rewards (N,), terminations (N,), truncations (N,), infos; all
            of them new arrays.

        Raises:
            ResetNeeded: there was no reset yet.
            ValueError: the actions are not N integers from 0 to 9.
        """
        if not self._is_reset:
            raise ResetNeeded("expected reset() before the first step()")
        commands = ACTIONS[_checked_actions(actions, self.num_envs)]
        running = self._fleet.status == IN_PROGRESS
        moving, ended = np.flatnonzero(running), np.flatnonzero(~running)
        if not self._parks:
            self._start(ended)
        if self._noise is not None:
            for row in moving:
                commands[row] = disturb_command(commands[row], self._noise, self._rngs[row])
        infos = self._infos(moving, self._fleet.drive(moving, commands))
        over = running & (self._fleet.status != IN_PROGRESS)
        images = self._images(moving if self._parks else np.arange(self.num_envs))
        if self._parks:
            images[ended] = self._parked_images[ended]
            self._parked_images[over] = images[over]
        truncations = over & (self._fleet.status == TIME_UP)
        return images, infos["dprog"].copy(), over & ~truncations, truncations, infos

    def close_extras(self, **kwargs: Any) -> None:
        """Let the threads go."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

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
            self._fleet.start(rows, self._given_starts[rows])
        else:
            places = [self._rngs[row].integers(START_PLACES) for row in rows]
            self._fleet.start(rows, np.array(places, dtype=np.float64) / START_PLACES)

    def _infos(self, moving: Rows, gained: Floats) -> Infos:
        return self._fleet.terms(moving, gained) | self._fleet.report()

    def _images(self, rows: Rows) -> Images:
        """Draw what these cars (K,) see in a new array (N, 120, 160, 1), the rest left unfilled."""
        images = np.empty((self.num_envs, HEIGHT, WIDTH, 1), np.uint8)
        if self._pool is None:
            self._draw(rows, images)
        else:
            parts = np.array_split(rows, self._threads)
            list(self._pool.map(self._draw, parts, [images] * len(parts)))
        return images

    def _draw(self, rows: Rows, images: Images) -> None:
        ground = self._ground
        picture = (ground.levels, ground.origin, ground.field, WALLS)
        render_rows(rows, self._fleet.states, 0.0, self._row_table, *picture, images, 0)
        if self._noise is not None:
            for row in rows:
                image = images[row, :, :, 0]
                image[:] = disturb_image(image, self._noise, self._rngs[row])


def _check_arguments(
    num_envs: int, car: str, max_steps: int, autoreset_mode: AutoresetMode, threads: int
) -> None:
    for name, value in (("num_envs", num_envs), ("max_steps", max_steps), ("threads", threads)):
        if value < 1:
            raise ValueError(f"expected {name} of at least 1, found {value}")
    if car not in CAR_PROFILES:
        raise ValueError(f"unknown car '{car}'; choose one of {', '.join(CAR_PROFILES)}")
    if autoreset_mode not in (AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED):
        raise ValueError(f"expected autoreset NEXT_STEP or DISABLED, found {autoreset_mode}")


def _checked_actions(actions: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    actions = np.asarray(actions)
    if actions.shape != (n,) or actions.dtype.kind not in "iu":
        raise ValueError(
            f"expected {n} integer actions, found shape {actions.shape} of {actions.dtype}"
        )
    if actions.min() < 0 or actions.max() >= len(ACTIONS):
        raise ValueError(f"expected actions from 0 to {len(ACTIONS) - 1}, found {actions}")
    return actions


def _lap_fractions(options: dict[str, Any] | None, n: int) -> Floats | None:
    if options is None or "lap_fraction" not in options:
        return None
    fractions = np.array(options["lap_fraction"], dtype=np.float64)
    if fractions.shape != (n,) or not np.isfinite(fractions).all():
        raise ValueError(f"expected {n} finite lap fractions, found {fractions}")
    return np.mod(fractions, 1.0)
