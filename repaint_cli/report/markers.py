"""The signs on maps: where something began and how it ended, and the legend that explains them."""

from collections.abc import Sequence
from typing import Any

from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from repaint_cli.report import style

Sign = dict[str, Any]
START: Sign = {"marker": "o", "color": "w", "markeredgecolor": style.INK, "markersize": 4.5}
CRASH: Sign = {"marker": "P", "color": "#56B4E9", "markeredgecolor": "w", "markersize": 9}
EXIT: Sign = {"marker": "X", "color": "#D55E00", "markeredgecolor": "w", "markersize": 8}
TARGET: Sign = {"marker": "*", "color": "#009E73", "markeredgecolor": "w", "markersize": 12}
TIP: Sign = {"marker": "o", "color": style.INK, "markeredgecolor": "none", "markersize": 3.6}


def legend(figure: Figure, signs: Sequence[Artist]) -> None:
    """Explain signs below a figure."""
    figure.legend(
        handles=list(signs),
        loc="outside lower center",
        ncols=len(signs),
        frameon=False,
        fontsize=style.NOTE_SIZE,
    )


def sign(name: str, drawn_as: Sign) -> Line2D:
    """Return what a legend shows for a sign."""
    return Line2D([], [], linestyle="none", label=name, **drawn_as)
