"""Drives a user's reward function before training does: along, across and off the road.

**N** cars. SI units.
"""

from collections import Counter
from time import perf_counter

import numpy as np

from repaint_cli.envs.output import CountedPrints, captured, output_to
from repaint_cli.envs.racer.deepracer.params import params_in
from repaint_cli.envs.racer.deepracer.reward_file import RewardFunction
from repaint_cli.envs.racer.dynamics.car import YAW
from repaint_cli.envs.racer.dynamics.commands import commands_for
from repaint_cli.envs.racer.dynamics.directions import Rows
from repaint_cli.envs.racer.dynamics.rules import IN_PROGRESS, LAP_COMPLETE
from repaint_cli.envs.racer.sight.noise import Noise, disturb_command
from repaint_cli.envs.racer.simulator import RacerSimulator
from repaint_cli.envs.racer.track.geometry import Floats
from repaint_cli.envs.racer.wander import EXPLORATION, STEPS_PER_AIM, fleet_of, nearest, steering_to
from repaint_cli.envs.reward_functions import FunctionCheck
from repaint_cli.errors import RewardFailed, some

N_CARS, N_STEPS = 64, 200
"""Of those that wander."""
MAX_ASIDE = 1.0
"""Farthest aim beside the centre line, in widths of the road; beyond 0.5 is off the road."""
LAP_CARS = 8
"""As many of them, or four on each track, keep to the middle instead, to the end of a lap."""
LAP_STEPS, LAP_SPEED = 4000, 1.0
"""They take so many steps at most, and of the listed speeds the greatest up to this, m/s."""
SECONDS = 15.0
"""After so long it is enough, however slow the function is."""
MOST_FAILURES = 3
"""After so many different ones it is enough."""
SLOW = 2e-3
"""Seconds a call from which on training is noticeably slower."""


class _Drive:
    """64 cars on all tracks; every other one in the other direction, every other two with noise."""

    def __init__(self, env: RacerSimulator, seed: int = 0) -> None:
        """Put the cars on the road.

        Raises:
            CardError: [env] is refused.
        """
        self.fleet = fleet_of(env, N_CARS)
        cars = np.arange(N_CARS)
        self._commands = commands_for(env.actions).examples
        self._rng = np.random.default_rng(seed)
        self._rngs = self._rng.spawn(N_CARS)
        self._reverse, self._noisy = cars % 2 == 1, cars // 2 % 2 == 1
        n = len(self.fleet.tracks)
        self._tracks = (cars // 4 if 4 * n <= N_CARS else cars) % n  # each in all the ways above
        self._n_lap_cars = max(LAP_CARS, min(4 * n, N_CARS // 2))
        self._laps = cars < self._n_lap_cars
        self._astray = ~self._laps & (cars % 4 == 0)  # these do not start along the road
        speeds = self._commands[:, 1]
        self._lap_speed = max(speeds[speeds <= LAP_SPEED], default=speeds.min())
        self._noise = Noise()
        self.n_laps = 0
        """Laps that were driven to their end."""
        self._start(cars)

    def _start(self, rows: Rows) -> None:
        places = self._rng.random(N_CARS)
        self.fleet.start(rows, places, self._reverse, self._rngs, self._tracks)
        astray = rows[self._astray[rows]]
        turns = self._rng.uniform(-np.pi, np.pi, len(astray))
        self.fleet.states[astray, YAW] += turns

    def step(self, t: int) -> tuple[Rows, Floats]:
        """Drive a step; return the cars that drove, (K,), and what all chose, (N, 2)."""
        fleet = self.fleet
        if t % STEPS_PER_AIM == 0:
            self._aims = self._rng.uniform(-MAX_ASIDE, MAX_ASIDE, N_CARS) * ~self._laps
            self._speeds = self._rng.choice(self._commands[:, 1], N_CARS)
            self._speeds[self._laps] = self._lap_speed
        rows = np.arange(N_CARS) if t < N_STEPS else np.flatnonzero(self._laps)
        ended = np.flatnonzero(fleet.status != IN_PROGRESS)
        self._start(np.intersect1d(rows, ended))
        angles = steering_to(fleet, self._aims)
        chosen = nearest(self._commands, angles, self._speeds)
        explores = ~self._laps & (self._rng.random(N_CARS) < EXPLORATION)
        chosen[explores] = self._rng.integers(len(self._commands), size=explores.sum())
        commands = self._commands[chosen]
        driven = commands.copy()
        for row in rows[self._noisy[rows]]:
            driven[row] = disturb_command(driven[row], self._noise, self._rngs[row])
        fleet.drive(rows, driven)
        finished = self._laps & (fleet.status == LAP_COMPLETE)
        self.n_laps += int(finished.sum())
        self._laps &= ~finished
        return rows, commands

    def is_enough(self, t: int) -> bool:
        """Return whether after t steps nothing new is to be expected."""
        return t >= N_STEPS and (2 * self.n_laps >= self._n_lap_cars or t >= LAP_STEPS)


def check_function(env: RacerSimulator, name: str, source: str) -> FunctionCheck:
    """Let a function pay 64 cars that drive in all ways, some of them to the end of a lap.

    Args:
        env: what is driven.
        name: the function's file, for messages.
        source: its text.

    Raises:
        CardError: the text does not run or has no such function, or [env] is refused.
    """
    output, paid, failed = CountedPrints(), list[float](), dict[str, RewardFailed]()
    drive, t, seconds = _Drive(env), 0, 0.0
    began = perf_counter()
    with output_to(output), captured():
        functions = [RewardFunction(name, source) for _ in range(N_CARS)]
        while not drive.is_enough(t) and perf_counter() - began < SECONDS:
            rows, chosen = drive.step(t)
            t += 1
            for row in rows.tolist():
                params = params_in(drive.fleet, row, chosen[row])
                before = perf_counter()
                try:
                    paid.append(functions[row](params, row))
                except RewardFailed as error:
                    failed.setdefault(error.place, error)
                seconds += perf_counter() - before
            if len(failed) >= MOST_FAILURES:
                break
    check = FunctionCheck(errors=list(failed.values()), warnings=list(output.warnings))
    if not failed:
        _describe(check, name, paid, seconds / len(paid), output.n_lines, drive.n_laps)
        if changed := functions[0].remembers():
            check.notes.append(
                f"{name} remembers, as its variables change: {some(changed)}; they last as long as "
                "a training, for each car of its own, and begin anew where a run is resumed"
            )
    return check


def _describe(
    check: FunctionCheck, name: str, paid: list[float], seconds: float, n_lines: int, n_laps: int
) -> None:
    """Add what a function pays and takes.

    Args:
        check: what to add to.
        name: the function's file.
        paid: what each call paid.
        seconds: of a call.
        n_lines: that all calls printed.
        n_laps: that were driven to their end.
    """
    (most, times), *_ = Counter(paid).most_common(1)
    lines = f"{n_lines / len(paid):.2g}"
    prints = f"{lines} line{'s' * (lines != '1')} a call" if n_lines else "nothing"
    check.notes.append(
        f"{name} pays {min(paid):.4g} to {max(paid):.4g} in {len(paid):,} steps of {N_CARS} cars "
        "along, across and off the road, in both directions, with and without noise, which end "
        f"{n_laps} lap{'s' * (n_laps != 1)}; {times / len(paid):.0%} of the steps are paid "
        f"{most:.4g}; a call takes {1e6 * seconds:,.0f} µs and prints {prints}"
    )
    if not n_laps:
        check.warnings.append(
            f"no car came to the end of a lap, so what {name} pays there was not tried"
        )
    if seconds > SLOW:
        check.warnings.append(
            f"a call of {name} takes {1e3 * seconds:.2g} ms, which makes 1,000 steps of training "
            f"{1e3 * seconds:.2g} s longer"
        )
