"""How races went: the columns of a table of evaluated episodes, and the same as JSON."""

from math import isnan
from typing import Any

import numpy as np

from repaint_cli.envs.episodes import Column, Episodes
from repaint_cli.envs.racer.names import STATUS


def columns(episodes: Episodes, s: int) -> list[Column]:
    """Return progress, laps, their times and crashes of seed s."""
    progress, status, seconds = _ends(episodes)
    return [
        Column("progress, %", progress[s]),
        Column("laps", seconds[s], "count"),
        Column("lap time, s", seconds[s]),
        Column("crashes, %", 100.0 * (status[s] == STATUS.index("crashed"))),
    ]


def outcomes(episodes: Episodes) -> dict[str, Any]:
    """Return progress (%), lap times (s) and how episodes ended, as JSON."""
    progress, status, seconds = _ends(episodes)
    return {
        "progress": progress.tolist(),
        "lap_times": [[None if isnan(time) else time for time in row] for row in seconds],
        "status": [[STATUS[int(code)] for code in row] for row in status],
    }


def _ends(episodes: Episodes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return progress (%), status and lap times (s), each (S, E), which every race records."""
    progress, status, seconds = episodes.progress, episodes.status, episodes.lap_times
    assert progress is not None
    assert status is not None
    assert seconds is not None
    return progress, status, seconds
