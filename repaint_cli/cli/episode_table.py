"""Evaluated episodes as a table for people."""

import numpy as np
from rich.console import Group
from rich.table import Column as TableColumn
from rich.table import Table
from rich.text import Text

from repaint_cli.cli.console import plain
from repaint_cli.envs.episodes import Column, Episodes, Parts
from repaint_cli.envs.simulator import Simulator
from repaint_cli.report.statistics import mean_ci


def table(name: str, seeds: list[int], env: Simulator, episodes: Episodes) -> Group:
    """Lay out a row per seed: mean return with its interval, and the columns of the simulator.

    Where episodes were played on several parts, such as tracks, each has a row below. The name
    stands above, as wide as the screen is, not as the table.
    """
    columns = [env.columns(episodes, s) for s in range(len(seeds))]
    parts = [env.parts(episodes, s) for s in range(len(seeds))]
    heads = ["return [95 % CI]", *(column.name for column in columns[0])]
    places = [_place_column(parts[0])] if parts[0] else []
    rows = Table("seed", *places, *heads, box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for s, seed in enumerate(seeds):
        returns, part = episodes.returns[s], parts[s]
        every = ["all"] if part else []
        rows.add_row(str(seed), *every, mean_interval(returns), *map(cell, columns[s]))
        for label, own in part.episodes.items() if part else ():
            cells = [cell(column._replace(values=column.values[own])) for column in columns[s]]
            rows.add_row("", plain(label), mean_interval(returns[own]), *cells)
    return Group(Text(plain(name), style="italic"), rows)


def _place_column(parts: Parts) -> TableColumn:
    """Return the column of the parts' names, which are not cut."""
    widest = max(len(plain(name)) for name in parts.episodes)
    return TableColumn(parts.name, min_width=widest)


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
