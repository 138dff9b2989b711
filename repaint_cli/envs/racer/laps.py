"""How long a lap takes, what came of laps in episodes, and what was mended in the track's file."""

from collections.abc import Sequence
from math import ceil, isnan
from typing import Any

from repaint_cli.envs.episodes import Column, Episodes
from repaint_cli.envs.racer.dynamics.car import STEP_SECONDS
from repaint_cli.envs.racer.names import STATUS
from repaint_cli.envs.racer.track.files import load_track

LEAST_LIMIT = 1500
"""Of an episode, steps, where the card says none."""

Actions = Sequence[tuple[float, float]]


def time_limit(track: str, actions: Actions) -> int:
    """Return one and a half times what a lap takes at the slowest action, or more, in steps."""
    slowest = min(speed for _, speed in actions)
    return max(LEAST_LIMIT, ceil(1.5 * _lap_steps(track, slowest)))


def doubts_about(track: str, actions: Actions, limit: int) -> list[str]:
    """Return a sentence where a lap takes longer than an episode may, `limit` steps."""
    speeds = [speed for _, speed in actions]
    for speed, which, what in (
        (max(speeds), "fastest", "no lap can be finished"),
        (min(speeds), "slowest", "a lap at the slowest action cannot be finished"),
    ):
        if (steps := ceil(_lap_steps(track, speed))) > limit:
            return [
                f"{what}: it takes {steps:,} steps at the {which} action's {speed:g} m/s, and "
                f"env.max_steps is {limit:,}; leave max_steps out, and it follows from the track"
            ]
    return []


def _lap_steps(track: str, speed: float) -> float:
    """Return how many steps a lap of the centre line takes at a speed, m/s."""
    return load_track(track).length / (speed * STEP_SECONDS)


def notes_on(name: str) -> list[str]:
    """Return a sentence where something was mended in a track's file."""
    track = load_track(name)
    return [f"track '{track.name}': {track.note}"] if track.note else []


def columns_of(episodes: Episodes, s: int) -> list[Column]:
    """Return progress, laps, their times and crashes of seed s; see `Simulator.columns`."""
    progress, status, seconds = episodes.progress, episodes.status, episodes.lap_times
    assert progress is not None
    assert status is not None
    assert seconds is not None
    return [
        Column("progress, %", progress[s]),
        Column("laps", seconds[s], "count"),
        Column("lap time, s", seconds[s]),
        Column("crashes, %", 100.0 * (status[s] == STATUS.index("crashed"))),
    ]


def outcomes_of(episodes: Episodes) -> dict[str, Any]:
    """Return progress (%), lap times (s) and how episodes ended; see `Simulator.outcomes`."""
    progress, status, seconds = episodes.progress, episodes.status, episodes.lap_times
    assert progress is not None
    assert status is not None
    assert seconds is not None
    return {
        "progress": progress.tolist(),
        "lap_times": [[None if isnan(time) else time for time in row] for row in seconds],
        "status": [[STATUS[int(code)] for code in row] for row in status],
    }
