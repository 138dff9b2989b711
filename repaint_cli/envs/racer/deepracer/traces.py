"""Races step by step, a trace per episode: what DeepRacer's logs hold and pictures are drawn from.

Angles are in degrees, as the logs have them; the other units are SI, progress is in percent.
**T** steps · **S** seeds · **N** environments or **E** episodes per seed.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from repaint_cli.envs.simulator import RacerEnv

if TYPE_CHECKING:
    from repaint_cli.learn.evaluation import Episodes
    from repaint_cli.learn.rollout.storage import Rollout


@dataclass(frozen=True)
class Trace:
    """One car's episode. Arrays are (T,)."""

    x: np.ndarray
    """Of the car's front point after each step, m."""
    y: np.ndarray
    """The same, m."""
    yaw: np.ndarray
    """Heading, degrees."""
    steer: np.ndarray
    """What was asked for, degrees; left is positive."""
    throttle: np.ndarray
    """What was asked for, m/s."""
    action: np.ndarray
    """Which action it was."""
    reward: np.ndarray
    """What the step earned."""
    all_wheels_on_track: np.ndarray
    """Whether they were."""
    progress: np.ndarray
    """Of the lap, since the start."""
    closest_waypoint: np.ndarray
    """Its index."""
    crashes: np.ndarray
    """How often the car has touched another by then."""
    status: str
    """How the episode ended, a name in the racer's STATUS."""

    def __len__(self) -> int:
        return len(self.x)

    @property
    def xy(self) -> np.ndarray:
        """Where the car's front point was after each step, (T, 2), m."""
        return np.stack([self.x, self.y], axis=1)


def driven(rollout: "Rollout", env: RacerEnv, s: int) -> list[Trace]:
    """Return a seed's training episodes, environment by environment; the last may be unfinished.

    Args:
        rollout: with the records of the racer.
        env: what was driven.
        s: which of the S seeds.
    """
    over = rollout.terminations | rollout.truncations
    return [
        _trace(rollout.records, rollout.actions, rollout.rewards, env, (steps, s, n))
        for n in range(rollout.valid.shape[2])
        for steps in _episodes(rollout.valid[:, s, n], over[:, s, n])
    ]


def played(episodes: "Episodes", env: RacerEnv, s: int) -> list[Trace]:
    """Return a seed's evaluated episodes.

    Args:
        episodes: of a racing task.
        env: what was driven.
        s: which of the S seeds.
    """
    return [
        _trace(episodes.records, episodes.actions, episodes.rewards, env, (np.arange(steps), s, e))
        for e, steps in enumerate(episodes.lengths[s])
    ]


def _episodes(valid: np.ndarray, over: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the steps of each episode of one environment; valid and over are (T,)."""
    steps = np.flatnonzero(valid)
    for episode in np.split(steps, np.flatnonzero(over[steps]) + 1):
        if len(episode):
            yield episode


def _trace(
    records: dict[str, np.ndarray],
    actions: np.ndarray,
    rewards: np.ndarray,
    env: RacerEnv,
    place: tuple[np.ndarray, int, int],
) -> Trace:
    """Cut an episode out of arrays (T, S, N)."""
    from repaint_cli.envs.racer.dynamics.car import commands_of
    from repaint_cli.envs.racer.dynamics.rules import STATUS

    at = {name: rows[place] for name, rows in records.items()}
    action = actions[place]
    steer, throttle = commands_of(env.actions)[action].T
    hit = at.get("hit", np.zeros(len(action)))
    return Trace(
        x=at["x"],
        y=at["y"],
        yaw=np.rad2deg(at["heading"]),
        steer=np.rad2deg(steer),
        throttle=throttle,
        action=action,
        reward=rewards[place],
        all_wheels_on_track=at["wheels_on"] == 4,
        progress=at["progress"],
        closest_waypoint=at["waypoint"].astype(int),
        crashes=(np.diff(hit, prepend=0) > 0).cumsum(),
        status=STATUS[int(at["status"][-1])],
    )
