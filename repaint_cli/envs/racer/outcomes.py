"""How episodes went: the columns of a table of evaluated episodes, and the same as JSON."""

from collections.abc import Sequence
from math import isnan
from typing import Any

import numpy as np

from repaint_cli.envs.episodes import Column, Episodes, Parts
from repaint_cli.envs.racer.names import STATUS, TRACK_RECORD


def columns(episodes: Episodes, s: int) -> list[Column]:
    """Return progress, laps, their times and crashes of seed s."""
    progress, status, seconds = _ends(episodes)
    return [
        Column("progress, %", progress[s]),
        Column("laps", seconds[s], "count"),
        Column("lap time, s", seconds[s]),
        Column("crashes, %", 100.0 * (status[s] == STATUS.index("crashed"))),
    ]


def parts(episodes: Episodes, s: int, names: Sequence[str]) -> Parts | None:
    """Return which episodes of seed s drove each of several tracks, given with their names."""
    driven = episodes.last(TRACK_RECORD)
    if driven is None:
        return None
    return Parts("track", {name: driven[s] == t for t, name in enumerate(names)})


def outcomes(
    episodes: Episodes, names: Sequence[str], lap_times: np.ndarray | None = None
) -> dict[str, Any]:
    """Return progress (%), lap times (s) and how episodes ended, as JSON; by track, too.

    Args:
        episodes: of all seeds.
        names: of the tracks.
        lap_times: of races the time of each lap, (S, E, L), s, nan where it was not completed.
    """
    progress, status, seconds = _ends(episodes)
    by_track = _by_track(episodes, names, seconds if lap_times is None else lap_times)
    return {
        "progress": progress.tolist(),
        "lap_times": [[None if isnan(time) else time for time in row] for row in seconds],
        "status": [[STATUS[int(code)] for code in row] for row in status],
    } | ({"tracks": by_track} if by_track else {})


def _by_track(episodes: Episodes, names: Sequence[str], lap_times: np.ndarray) -> dict[str, Any]:
    """Return which episodes drove each of several tracks, and how each seed did there."""
    driven = episodes.last(TRACK_RECORD)
    if driven is None:
        return {}
    progress, _, _ = _ends(episodes)
    by_track = {}
    for t, name in enumerate(names):
        own = [np.flatnonzero(row == t) for row in driven]  # [S] of episodes
        laps = [row[e][~np.isnan(row[e])] for row, e in zip(lap_times, own, strict=True)]
        by_track[name] = {
            "episodes": [e.tolist() for e in own],
            "mean_return": _means(episodes.returns, own),
            "mean_progress": _means(progress, own),
            "laps": [len(times) for times in laps],
            "mean_lap_time": [float(times.mean()) if len(times) else None for times in laps],
        }
    return by_track


def _means(numbers: np.ndarray, own: Sequence[np.ndarray]) -> list[float]:
    """Return the mean over each seed's own episodes of numbers (S, E)."""
    return [float(row[e].mean()) for row, e in zip(numbers, own, strict=True)]


def _ends(episodes: Episodes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return progress (%), status and lap times (s), each (S, E), which every race records."""
    progress, status, seconds = episodes.progress, episodes.status, episodes.lap_times
    assert progress is not None
    assert status is not None
    assert seconds is not None
    return progress, status, seconds
