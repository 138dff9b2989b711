"""Evaluated episodes as a table for people."""

import numpy as np
from rich.console import Console, ConsoleOptions, Group, RenderResult
from rich.measure import Measurement
from rich.table import Column as TableColumn
from rich.table import Table
from rich.text import Text

from repaint_cli.cli.console import plain
from repaint_cli.envs.episodes import Column, Episodes, Parts
from repaint_cli.envs.simulator import Simulator
from repaint_cli.report.statistics import mean_ci

MOST_COLUMNS = 1000
"""Of a screen, to measure a table that may be as wide as it likes."""


def table(name: str, seeds: list[int], env: Simulator, episodes: Episodes) -> Group:
    """Lay out a row per seed: mean return with its interval, and the columns of the simulator.

    Where episodes were played on several parts, such as tracks, each has a row below. The name
    stands above, as wide as the screen is, not as the table.
    """
    return Group(Text(plain(name), style="italic"), _Rows(seeds, env, episodes))


class _Rows:
    """The rows; on a screen that is too narrow some columns have no intervals, or none has."""

    def __init__(self, seeds: list[int], env: Simulator, episodes: Episodes) -> None:
        levels = (False, False), (False, True), (True, True)
        self._tables = [_rows(seeds, env, episodes, *level) for level in levels]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        wide = options.update(width=MOST_COLUMNS)
        widths = (Measurement.get(console, wide, rows).maximum for rows in self._tables)
        fitting = (
            rows
            for rows, width in zip(self._tables, widths, strict=True)
            if width <= options.max_width
        )
        yield next(fitting, self._tables[-1])


def _rows(
    seeds: list[int], env: Simulator, episodes: Episodes, short_returns: bool, short: bool
) -> Table:
    """Return a table whose returns, or whose other columns, have no intervals where short."""
    head = "return" if short_returns else "return [95 % CI]"
    columns = [
        [Column(head, episodes.returns[s]), *env.columns(episodes, s)] for s in range(len(seeds))
    ]
    parts = [env.parts(episodes, s) for s in range(len(seeds))]
    places = [_place_column(parts[0])] if parts[0] else []
    heads = [column.name for column in columns[0]]
    rows = Table("seed", *places, *heads, box=None, pad_edge=False, padding=(0, 2, 0, 0))

    def cells(s: int, own: np.ndarray | slice) -> list[str]:
        first, *others = (column._replace(values=column.values[own]) for column in columns[s])
        return [cell(first, short=short_returns), *(cell(other, short=short) for other in others)]

    for s, (seed, part) in enumerate(zip(seeds, parts, strict=True)):
        rows.add_row(str(seed), *(["all"] if part else []), *cells(s, slice(None)))
        for label, own in part.episodes.items() if part else ():
            rows.add_row("", plain(label), *cells(s, own))
    return rows


def _place_column(parts: Parts) -> TableColumn:
    """Return the column of the parts' names, which are not cut."""
    widest = max(len(plain(name)) for name in parts.episodes)
    return TableColumn(parts.name, min_width=widest)


def cell(column: Column, *, short: bool = False) -> str:
    """Return the text of a seed's cell in a column; a `short` one has no interval."""
    known = column.values[~np.isnan(column.values)]
    if column.shown == "count":
        return f"{len(known)} of {len(column.values)}"
    if column.shown == "mean":
        return f"{known.mean():.0f}"
    if not len(known):
        return "-"
    return _short(float(known.mean())) if short else mean_interval(known)


def mean_interval(numbers: np.ndarray) -> str:
    """Return a mean with its 95 % interval, which a single number does not have."""
    mean, low, high = mean_ci(numbers)
    return _short(mean) + ("" if np.isnan(low) else f" [{_short(low)}, {_short(high)}]")


def _short(number: float) -> str:
    """Write three digits, or all before the point."""
    return f"{number:.0f}" if abs(number) >= 100 else f"{number:.3g}"
