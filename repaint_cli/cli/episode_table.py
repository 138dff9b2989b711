"""Played episodes in words: a table for people, JSON for programs."""

import numpy as np
from rich.table import Table

from repaint_cli.cli.console import literal
from repaint_cli.learn.evaluation import Episodes
from repaint_cli.statistics import mean_ci


def racing_summary(played: Episodes) -> dict[str, object]:
    """Return the numbers of races as JSON: progress (%), lap times (s), how episodes ended."""
    from repaint_cli.envs.racer.dynamics.rules import STATUS

    if played.progress is None or played.status is None or played.lap_times is None:
        return {}
    seconds = played.lap_times
    return {
        "progress": played.progress.tolist(),
        "lap_times": [[None if np.isnan(time) else time for time in row] for row in seconds],
        "status": [[STATUS[int(code)] for code in row] for row in played.status],
    }


def table(name: str, seeds: list[int], played: Episodes) -> Table:
    """Lay a row per seed: mean return with its interval over episodes, and laps or the length."""
    racing = played.progress is not None
    more = ["progress, %", "laps", "lap time, s", "crashes, %"] if racing else ["length"]
    heads = ("seed", "return [95 % CI]", *more)
    rows = Table(*heads, title=literal(name), title_justify="left", box=None, padding=(0, 1, 0, 0))
    for s, seed in enumerate(seeds):
        cells = laps(played, s) if racing else [f"{played.lengths[s].mean():.0f}"]
        rows.add_row(str(seed), interval(played.returns[s]), *cells)
    return rows


def laps(played: Episodes, s: int) -> list[str]:
    """Return a seed's progress, laps, lap times and crashes, for people."""
    from repaint_cli.envs.racer.dynamics.rules import STATUS

    progress, status, seconds = played.progress, played.status, played.lap_times
    assert progress is not None
    assert status is not None
    assert seconds is not None
    whole = seconds[s][~np.isnan(seconds[s])]
    crashed = status[s] == STATUS.index("crashed")
    return [
        interval(progress[s]),
        f"{len(whole)} of {len(seconds[s])}",
        interval(whole) if len(whole) else "-",
        interval(100.0 * crashed),
    ]


def interval(numbers: np.ndarray) -> str:
    """Return a mean with its 95 % interval, which one number has not."""
    mean, low, high = mean_ci(numbers)
    return _short(mean) + ("" if np.isnan(low) else f" [{_short(low)}, {_short(high)}]")


def _short(number: float) -> str:
    """Write three digits, or all before the point."""
    return f"{number:.0f}" if abs(number) >= 100 else f"{number:.3g}"
