"""Cars that drive all over the road and sometimes off it: a sample of states for reward terms."""

from collections.abc import Iterator

import numpy as np

from repaint_cli.envs.racer.dynamics.directions import Rows
from repaint_cli.envs.racer.dynamics.fleet import Fleet
from repaint_cli.envs.racer.dynamics.rules import IN_PROGRESS
from repaint_cli.envs.racer.track.geometry import Floats

LOOK_AHEAD = 0.5
"""From a car to its aim, along the centre line, m."""
MAX_ASIDE = 0.65
"""Farthest aim beside the centre line, in widths of the road; beyond 0.5 is off the road."""
STEPS_PER_AIM = 30
"""Steps after which a car aims at another place across the road."""
EXPLORATION = 0.1
"""ε, the share of steps with a uniformly random action."""


def wander(
    fleet: Fleet, commands: Floats, n_steps: int, seed: int
) -> Iterator[tuple[Rows, Floats]]:
    """Drive all cars of a fleet for some steps, from places all over the lap.

    A car whose episode has ended begins another.

    Args:
        fleet: N cars.
        commands: to choose from, steering (rad) and speed (m/s), (A, 2).
        n_steps: T.
        seed: of all random numbers.

    Yields:
        after each step the cars that drove and their gains, as `Fleet.terms` takes them.
    """
    n, rng = len(fleet.states), np.random.default_rng(seed)
    rngs = rng.spawn(n)
    rows, reverse = np.arange(n), np.zeros(n, np.bool_)
    fleet.start(rows, rng.random(n), reverse, rngs)
    for t in range(n_steps):
        if t % STEPS_PER_AIM == 0:
            aims, speeds = (
                rng.uniform(-MAX_ASIDE, MAX_ASIDE, n),
                rng.integers(len(commands), size=n),
            )
        ended = np.flatnonzero(fleet.status != IN_PROGRESS)
        fleet.start(ended, rng.random(n), reverse, rngs)
        chosen = _nearest(commands, _steering(fleet, aims), commands[speeds, 1])
        explores = rng.random(n) < EXPLORATION
        chosen[explores] = rng.integers(len(commands), size=explores.sum())
        yield rows, fleet.drive(rows, commands[chosen])


def _steering(fleet: Fleet, aims: Floats) -> Floats:
    """Return the angles that lead to places ahead, aside by `aims` (N,) widths, (N,) rad."""
    track, state = fleet.track, fleet.report()
    points, headings = track.pose_at(fleet.lap_fractions + LOOK_AHEAD / track.length)
    aside = aims * track.width
    to_x = points[:, 0] - aside * np.sin(headings) - state["x"]
    to_y = points[:, 1] + aside * np.cos(headings) - state["y"]
    angle = np.arctan2(to_y, to_x) - state["heading"]
    return np.asarray(np.arctan2(np.sin(angle), np.cos(angle)))


def _nearest(commands: Floats, steering: Floats, speed: Floats) -> Rows:
    """Return the actions nearest to angles (N,) rad, then to speeds (N,) m/s."""
    steering_gaps = np.abs(commands[:, 0] - steering[:, None])  # (N, A)
    speed_gaps = np.abs(commands[:, 1] - speed[:, None])
    return np.asarray((steering_gaps + 1e-3 * speed_gaps).argmin(axis=1))
