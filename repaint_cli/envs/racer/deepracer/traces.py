"""Races step by step, a trace per episode: what DeepRacer's logs hold and pictures are drawn from.

Angles are in degrees, as the logs have them; the other units are SI, progress is in percent.
**T** steps · **S** seeds · **N** environments or **E** episodes per seed.
"""

from dataclasses import dataclass

import numpy as np

from repaint_cli.envs.episodes import Steps
from repaint_cli.envs.racer.actions import Actions
from repaint_cli.envs.racer.dynamics.commands import Commands, commands_for
from repaint_cli.envs.racer.names import STATUS, TRACK_RECORD


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
    """Steering command, degrees; left is positive."""
    throttle: np.ndarray
    """Speed command, m/s."""
    action: np.ndarray
    """Which action it was; -1 within ranges, where no action has a number."""
    reward: np.ndarray
    """What the step earned; of a user's function what it paid, before any scale."""
    all_wheels_on_track: np.ndarray
    """Whether all wheels were on the track."""
    progress: np.ndarray
    """Of the lap, since the start."""
    closest_waypoint: np.ndarray
    """Its index."""
    crashes: np.ndarray
    """How often the car has touched another by then."""
    status: str
    """How the episode ended, a name in the racer's STATUS."""
    track: int = 0
    """Which of the tracks it drove."""

    def __len__(self) -> int:
        return len(self.x)

    @property
    def xy(self) -> np.ndarray:
        """Where the car's front point was after each step, (T, 2), m."""
        return np.stack([self.x, self.y], axis=1)


def traces_of(steps: Steps, actions: Actions, s: int, scale: float = 1.0) -> list[Trace]:
    """Return a seed's episodes, environment by environment; the last may be unfinished.

    Args:
        steps: with the records of the racer.
        actions: what the cars chose among, steering (degrees) and speed (m/s), or ranges.
        s: which of the S seeds.
        scale: what pay was multiplied by to be the rewards of the steps.
    """
    commands = commands_for(actions)
    return [_trace(steps, commands, episode, scale) for episode in steps.episodes(s)]


def _trace(
    steps: Steps,
    commands: Commands,
    episode: tuple[np.ndarray, int, int],
    scale: float,
) -> Trace:
    """Cut an episode out of arrays (T, S, N)."""
    at = {name: rows[episode] for name, rows in steps.records.items()}
    action = steps.actions[episode]
    steer, throttle = commands.of(action).T
    hit = at.get("hit", np.zeros(len(action)))
    return Trace(
        x=at["x"],
        y=at["y"],
        yaw=np.rad2deg(at["heading"]),
        steer=np.rad2deg(steer),
        throttle=throttle,
        action=commands.numbers(action),
        reward=steps.rewards[episode] / scale,
        all_wheels_on_track=at["wheels_on"] == 4,
        progress=at["progress"],
        closest_waypoint=at["waypoint"].astype(int),
        crashes=(np.diff(hit, prepend=0) > 0).cumsum(),
        status=STATUS[int(at["status"][-1])],
        track=int(at[TRACK_RECORD][-1]) if TRACK_RECORD in at else 0,
    )
