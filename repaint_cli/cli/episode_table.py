"""Evaluated episodes as a table for people."""

import numpy as np
from rich.console import Group
from rich.table import Table
from rich.text import Text

from repaint_cli.cli.console import plain
from repaint_cli.envs.episodes import Column, Episodes
from repaint_cli.envs.simulator import Simulator
from repaint_cli.report.statistics import mean_ci


def table(name: str, seeds: list[int], env: Simulator, episodes: Episodes) -> Group:
    """Lay out a row per seed: mean return with its interval, and the columns of the simulator.

    The name stands above, as wide as the screen is, not as the table.
    """
    columns = [env.columns(episodes, s) for s in range(len(seeds))]
    heads = ("seed", "return [95 % CI]", *(column.name for column in columns[0]))
    rows = Table(*heads, box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for s, seed in enumerate(seeds):
        rows.add_row(str(seed), mean_interval(episodes.returns[s]), *map(cell, columns[s]))
    return Group(Text(plain(name), style="italic"), rows)


def cell(column: Column) -> str:
    """Return the text of a seed's cell in a column."""
    known = column.values[~np.isnan(column.values)]
    if column.shown == "count":
        return f"{len(known)} of {len(column.values)}"
    if column.shown == "mean":
        return f"{known.mean():.0f}"
    return mean_interval(known) if len(known) else "-"


def mean_interval(numbers: np.ndarray) -> str:
    """Return a mean with its 95 % interval, which a single number does not have."""
    mean, low, high = mean_ci(numbers)
    return _short(mean) + ("" if np.isnan(low) else f" [{_short(low)}, {_short(high)}]")


def _short(number: float) -> str:
    """Write three digits, or all before the point."""
    return f"{number:.0f}" if abs(number) >= 100 else f"{number:.3g}"
