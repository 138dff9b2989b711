"""Cars that drive all over the road and sometimes off it: a sample of states for reward terms."""

from collections.abc import Iterator

import numpy as np

from repaint_cli.envs.racer.deepracer.params import params_in
from repaint_cli.envs.racer.deepracer.reward_file import RewardFunction
from repaint_cli.envs.racer.dynamics.commands import commands_for
from repaint_cli.envs.racer.dynamics.directions import Rows
from repaint_cli.envs.racer.dynamics.fleet import Fleet
from repaint_cli.envs.racer.dynamics.rules import IN_PROGRESS
from repaint_cli.envs.racer.simulator import RacerSimulator
from repaint_cli.envs.racer.track.files import load_tracks
from repaint_cli.envs.racer.track.geometry import Floats
from repaint_cli.errors import CardError

N_CARS, N_STEPS = 64, 250
"""Whose states a reward function is judged on."""
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
) -> Iterator[tuple[Rows, Floats, Floats]]:
    """Drive all cars of a fleet for some steps, from places all over the lap, on all its tracks.

    A car whose episode has ended begins another.

    Args:
        fleet: N cars.
        commands: to choose from, steering (rad) and speed (m/s), (A, 2).
        n_steps: T.
        seed: of all random numbers.

    Yields:
        after each step the cars that drove, their commands (N, 2), and their gains, as
        `Fleet.terms` takes them.
    """
    n, rng = len(fleet.states), np.random.default_rng(seed)
    rngs = rng.spawn(n)
    rows, reverse = np.arange(n), np.zeros(n, np.bool_)
    fleet.start(rows, rng.random(n), reverse, rngs, rows % len(fleet.tracks))
    for t in range(n_steps):
        if t % STEPS_PER_AIM == 0:
            aims, speeds = (
                rng.uniform(-MAX_ASIDE, MAX_ASIDE, n),
                rng.integers(len(commands), size=n),
            )
        ended = np.flatnonzero(fleet.status != IN_PROGRESS)
        fleet.start(ended, rng.random(n), reverse, rngs)
        chosen = nearest(commands, steering_to(fleet, aims), commands[speeds, 1])
        explores = rng.random(n) < EXPLORATION
        chosen[explores] = rng.integers(len(commands), size=explores.sum())
        yield rows, commands[chosen], fleet.drive(rows, commands[chosen])


def steering_to(fleet: Fleet, aims: Floats) -> Floats:
    """Return the angles that lead to places ahead, aside by `aims` (N,) widths, (N,) rad.

    Args:
        fleet: N cars.
        aims: to the left, in widths of the road.
    """
    roads, state = fleet.directions, fleet.report()
    points, headings = roads.poses_at(fleet.lap_fractions + LOOK_AHEAD / roads.each("length"))
    aside = aims * roads.each("width")
    to_x = points[:, 0] - aside * np.sin(headings) - state["x"]
    to_y = points[:, 1] + aside * np.cos(headings) - state["y"]
    angle = np.arctan2(to_y, to_x) - state["heading"]
    return np.asarray(np.arctan2(np.sin(angle), np.cos(angle)))


def nearest(commands: Floats, steering: Floats, speed: Floats) -> Rows:
    """Return the actions nearest to angles (N,) rad, then to speeds (N,) m/s."""
    steering_gaps = np.abs(commands[:, 0] - steering[:, None])  # (N, A)
    speed_gaps = np.abs(commands[:, 1] - speed[:, None])
    return np.asarray((steering_gaps + 1e-3 * speed_gaps).argmin(axis=1))


def fleet_of(env: RacerSimulator, n: int) -> Fleet:
    """Return N cars with what a card says of them; `start` puts them on the road.

    Raises:
        CardError: [env] is refused.
    """
    tracks = load_tracks(env.tracks, env.waypoints)
    try:
        return Fleet(tracks, n, env.car, env.longest_episode(), env.objects, env.crash)
    except ValueError as error:
        raise CardError(f"[env]: {error}") from error


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
    fleet = fleet_of(env, N_CARS)
    functions = [RewardFunction(name, source) for _ in range(N_CARS)]
    phi, rewards, names = [], [], list[str]()
    commands = commands_for(env.actions).examples
    for rows, chosen, gained in wander(fleet, commands, N_STEPS, seed=0):
        terms = fleet.terms(rows, gained)
        names = list(terms)
        phi.append(np.stack([*terms.values()], axis=1))
        rewards += [
            functions[row](params_in(fleet, row, chosen[row]), row) for row in rows.tolist()
        ]
    return np.concatenate(phi), np.array(rewards), names
