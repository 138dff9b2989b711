"""Markers on maps, of starts and of ends of episodes, and their legend."""

from collections.abc import Sequence
from typing import Any

from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from repaint_cli.report import style

Marker = dict[str, Any]
START: Marker = {"marker": "o", "color": "w", "markeredgecolor": style.INK, "markersize": 4.5}
CRASH: Marker = {"marker": "P", "color": "#56B4E9", "markeredgecolor": "w", "markersize": 9}
EXIT: Marker = {"marker": "X", "color": "#D55E00", "markeredgecolor": "w", "markersize": 8}
TARGET: Marker = {"marker": "*", "color": "#009E73", "markeredgecolor": "w", "markersize": 12}
TIP: Marker = {"marker": "o", "color": style.INK, "markeredgecolor": "none", "markersize": 3.6}


def legend(figure: Figure, entries: Sequence[Artist]) -> None:
    """Draw a legend below a figure."""
    figure.legend(
        handles=list(entries),
        loc="outside lower center",
        ncols=len(entries),
        frameon=False,
        fontsize=style.NOTE_SIZE,
    )


def legend_entry(name: str, marker: Marker) -> Line2D:
    """Return the legend's entry of a marker."""
    return Line2D([], [], linestyle="none", label=name, **marker)
