"""Cars that wander over the whole road and sometimes off it: states to judge rewards on."""

from collections.abc import Iterator

import numpy as np

from repaint_cli.envs.racer.deepracer.reward_file import RewardFunction
from repaint_cli.envs.racer.dynamics.car import commands_of
from repaint_cli.envs.racer.dynamics.fleet import Fleet, Rows
from repaint_cli.envs.racer.dynamics.rules import IN_PROGRESS
from repaint_cli.envs.racer.simulator import RacerSimulator
from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.envs.racer.track.track import Floats
from repaint_cli.errors import CardError

N_CARS, N_STEPS = 64, 250
"""Whose states a reward function is judged on."""
LOOK_AHEAD = 0.5
"""How far ahead along the centre line a car aims, m."""
WIDEST = 0.65
"""How far aside of it at most, in widths of the road; a car off its edge leaves it."""
MOODS = 30
"""Steps after which a car aims at another place across the road."""
WHIMS = 0.1
"""Share of steps with any action at all."""


def wander(
    fleet: Fleet, commands: Floats, n_steps: int, seed: int
) -> Iterator[tuple[Rows, Floats]]:
    """Drive all cars of a fleet for some steps, from places all over the lap.

    A car whose episode has ended begins another.

    Args:
        fleet: N cars.
        commands: what they may do, steering (rad) and speed (m/s), (A, 2).
        n_steps: how long.
        seed: of everything.

    Yields:
        after each step the cars that drove and what each gained, as `Fleet.terms` takes them.
    """
    n, rng = len(fleet.states), np.random.default_rng(seed)
    rngs = rng.spawn(n)
    rows, reverse = np.arange(n), np.zeros(n, np.bool_)
    fleet.start(rows, rng.random(n), reverse, rngs)
    for t in range(n_steps):
        if t % MOODS == 0:
            aims, speeds = rng.uniform(-WIDEST, WIDEST, n), rng.integers(len(commands), size=n)
        ended = np.flatnonzero(fleet.status != IN_PROGRESS)
        fleet.start(ended, rng.random(n), reverse, rngs)
        chosen = _nearest(commands, _steering(fleet, aims), commands[speeds, 1])
        whims = rng.random(n) < WHIMS
        chosen[whims] = rng.integers(len(commands), size=whims.sum())
        yield rows, fleet.drive(rows, commands[chosen])


def _steering(fleet: Fleet, aims: Floats) -> Floats:
    """Return the angles that lead to places ahead, aside by `aims` (N,) widths, (N,) rad."""
    track, told = fleet.track, fleet.report()
    points, headings = track.pose_at(fleet.lap_fractions + LOOK_AHEAD / track.length)
    aside = aims * track.width
    to_x = points[:, 0] - aside * np.sin(headings) - told["x"]
    to_y = points[:, 1] + aside * np.cos(headings) - told["y"]
    angle = np.arctan2(to_y, to_x) - told["heading"]
    return np.asarray(np.arctan2(np.sin(angle), np.cos(angle)))


def _nearest(commands: Floats, steering: Floats, speed: Floats) -> Rows:
    """Return the actions nearest to angles (N,) rad, then to speeds (N,) m/s."""
    apart = np.abs(commands[:, 0] - steering[:, None])  # (N, A)
    slack = 1e-3 * np.abs(commands[:, 1] - speed[:, None])
    return np.asarray((apart + slack).argmin(axis=1))


def sample_rewards(
    env: RacerSimulator, name: str, source: str
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Return what 64 wandering cars meet: φ (B, F), a reward function's pay (B,), names of φ.

    Args:
        env: what is driven.
        name: the function's file, for messages.
        source: its text.

    Raises:
        CardError: the function failed, or [env] is refused.
    """
    track = load_track(env.track)
    try:
        fleet = Fleet(track, N_CARS, env.car, env.max_steps, env.n_bots, env.crash)
    except ValueError as error:
        raise CardError(f"[env]: {error}") from error
    functions = [RewardFunction(name, source) for _ in range(N_CARS)]
    phi, rewards, names = [], [], list[str]()
    for rows, gained in wander(fleet, commands_of(env.actions), N_STEPS, seed=0):
        terms = fleet.terms(rows, gained)
        names = list(terms)
        phi.append(np.stack([*terms.values()], axis=1))
        rewards += [functions[row](fleet.params(row), row) for row in rows.tolist()]
    return np.concatenate(phi), np.array(rewards), names
