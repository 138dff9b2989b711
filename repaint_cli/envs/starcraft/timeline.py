"""Episodes over time: what was there, built and killed, a column of panels an evaluation.

**S** seeds · **E** episodes a seed · **T** steps.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from repaint_cli.envs.episodes import EpisodePaths, Episodes
from repaint_cli.envs.paths import PathFormat
from repaint_cli.report import style
from repaint_cli.report.path_panels import label_of

LINE = style.METHOD_COLOURS["repaint"]
"""The colour of what is counted; what is behind it is grey."""


class Row(NamedTuple):
    """A panel of each column."""

    name: str
    """What it shows."""
    record: str
    """The record of it."""
    behind: str | None
    """The record that is drawn behind it in grey, if any."""
    builds: bool | None
    """Whether only games show it in which something is built, or only those with zerglings."""


ROWS = (
    Row("supply", "food_used", "food_cap", True),
    Row("minerals", "minerals", None, True),
    Row("SCVs", "scvs", None, True),
    Row("marines", "army", "sum_marines_built", None),
    Row("zerglings killed", "sum_zerglings_killed", None, False),
)
"""From top to bottom."""

WIDTHS, ROW_HEIGHT = (6.4, 4.2, 3.4, 2.4), 1.25
"""Of a panel, inches: where there is one column, where there are two, three, or more."""
NOTE = "thin: episodes; thick: their mean; grey: the limit of the supply, all marines ever built"


class Timelines(PathFormat):
    """The course of games: supply, minerals, SCVs, marines and kills over time."""

    records: ClassVar[tuple[str, ...]] = tuple(
        name for row in ROWS for name in (row.record, row.behind) if name
    )

    def __init__(self, builds: bool, fights: bool) -> None:
        """Show what is built and whom one fights, where the game has that."""
        has = {None: True, True: builds, False: fights}
        self._rows = [row for row in ROWS if has[row.builds]]

    def paths_of(
        self,
        valid: np.ndarray,
        records: Mapping[str, np.ndarray],
        observations: Callable[[], np.ndarray],
    ) -> EpisodePaths:
        """Return how many marines were built by each second, (S, E, T, 2)."""
        lines = np.stack([records["seconds"], records["sum_marines_built"]], -1)  # (T, S, E, 2)
        return EpisodePaths(np.moveaxis(lines, 0, 2))

    def draw(
        self, panels: Sequence[tuple[str, Episodes]], path: Path, title: str, colour: str
    ) -> None:
        """Draw the first seed's episodes, a column of panels each; see `PathFormat.draw`."""
        width = 0.8 + WIDTHS[min(len(panels), len(WIDTHS)) - 1] * len(panels)
        rows = self._rows
        figure = style.new_figure(width, 1.5 + ROW_HEIGHT * len(rows))
        style.headline(figure, title)
        grid = figure.subplots(len(rows), len(panels), squeeze=False, sharex=True, sharey="row")
        for column, (name, episodes) in zip(grid.T, panels, strict=True):
            for axes, row in zip(column, rows, strict=True):
                if row.behind:
                    _lines(axes, episodes, row.behind, style.FAINT)
                _lines(axes, episodes, row.record, LINE)
            label = label_of(name, episodes.returns[0].mean())
            column[0].set_title(label, size=style.TEXT_SIZE - 0.5, color=style.INK)
            column[-1].set_xlabel("game time [s]", size=style.NOTE_SIZE)
        for axes in grid.ravel():
            _frame(axes)
        for axes, row in zip(grid[:, 0], rows, strict=True):
            axes.set_ylabel(row.name, size=style.NOTE_SIZE)
        figure.align_ylabels(grid[:, 0])
        figure.supxlabel(NOTE, size=style.NOTE_SIZE, color=style.INK)
        style.save(figure, path)


def _frame(axes: Axes) -> None:
    """Leave two spines, and lines to read heights off from 0 on."""
    style.tidy(axes)
    axes.grid(axis="y", color="#e6e6e6", linewidth=0.7)
    axes.set_axisbelow(True)
    axes.set_ylim(bottom=0, top=max(1.0, axes.get_ylim()[1]))
    axes.margins(x=0.01)
    axes.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10], integer=True))


def _lines(axes: Axes, episodes: Episodes, record: str, colour: str) -> None:
    """Draw a line per episode of the first seed, and where there are several their mean."""
    assert episodes.paths is not None
    times = episodes.paths[0, :, :, 0].T  # (T, E)
    numbers = episodes.records[record][:, 0]
    several = numbers.shape[1] > 1
    axes.plot(times, numbers, color=colour, linewidth=0.7, alpha=0.45 if several else 1)
    if several:
        longest = times[:, np.argmax(episodes.lengths[0])]
        axes.plot(longest, _mean(numbers), color=colour, linewidth=1.6)


def _mean(numbers: np.ndarray) -> np.ndarray:
    """Return the mean over the episodes that still run, (T, E) → (T,); nan where none does."""
    running = np.isfinite(numbers)
    count = running.sum(1)
    total: np.ndarray = np.where(running, numbers, 0).sum(1)
    mean = np.full(len(total), np.nan)
    np.divide(total, count, out=mean, where=count > 0)
    return mean
