"""The style of every figure: colours that colour-blind people can tell apart, sizes, saving.

Figures are `matplotlib.figure.Figure` on the Agg canvas; pyplot and its global state stay out.
"""

from collections.abc import Iterable
from itertools import cycle
from pathlib import Path
from textwrap import wrap
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Colormap, LinearSegmentedColormap, to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.typing import RcKeyType

from repaint_cli.files.atomic import atomic_write
from repaint_cli.files.foreign import PICTURE_MARK

INK, FAINT = "#222222", "#8c8c8c"
TITLE_SIZE, TEXT_SIZE, NOTE_SIZE = 12, 10, 8.5
DPI = 150
LEGEND_LETTERS = 32
"""Of a line of a legend."""

SAVED: dict[RcKeyType, Any] = {
    "svg.hashsalt": "repaint", "svg.fonttype": "none", "text.usetex": False,
}  # fmt: skip
"""Settings under which a figure is saved, whatever those of who calls us."""

METHOD_COLOURS = {  # Okabe and Ito's palette
    "scratch": "#000000",
    "warm-start": "#E69F00",
    "kickstart": "#009E73",
    "instance": "#CC79A7",
    "repaint": "#0072B2",
    "repaint-joint": "#56B4E9",
}
SPARE_COLOURS = ("#D55E00", "#999999", "#7A5195", "#8C6D31")
ON_DARK = {  # the same colours where the paper is dark, those that need another lightness
    "#000000": "#F2F0EA",
    "#0072B2": "#3B9FE0",
    "#56B4E9": "#A6DEFF",
    "#009E73": "#1FC08F",
    "#D55E00": "#FF7F3A",
    "#7A5195": "#B78FD6",
    "#8C6D31": "#C6A55C",
}


def colours_of(labels: Iterable[str]) -> dict[str, str]:
    """Give each label a colour: a method always its own, anything else one of the spare ones.

    A label belongs to a method if its first word is the method's name: "repaint ζ 0.4" is blue.
    """
    spare, given = cycle(SPARE_COLOURS), dict[str, str]()
    for label in labels:
        colour = METHOD_COLOURS.get(label.split(" ")[0], "")
        given[label] = colour if colour and colour not in given.values() else next(spare)
    return given


def darker(colour: str, share: float = 0.3) -> str:
    """Mix a colour with black, so that text in it is readable on white."""
    red, green, blue = to_rgb(colour)
    return to_hex((red * (1 - share), green * (1 - share), blue * (1 - share)))


def ramp() -> Colormap:
    """Return the colours of a quantity: dark blue to light orange, readable on a grey road."""
    stops = ["#0b1d51", "#3b3fa0", "#a02c8a", "#e0533d", "#ffc233"]
    return LinearSegmentedColormap.from_list("repaint", stops)


def new_figure(width: float, height: float) -> Figure:
    """Make an empty white figure of so many inches."""
    figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def one_panel(width: float, height: float, title: str) -> tuple[Figure, Axes]:
    """Make a figure of so many inches with a title and one panel, whose heights can be read off."""
    figure = new_figure(width, height)
    headline(figure, title)
    axes: Axes = figure.subplots()
    tidy(axes)
    axes.grid(axis="y", color="#e6e6e6", linewidth=0.7)
    axes.set_axisbelow(True)
    return figure, axes


def headline(figure: Figure, title: str) -> None:
    """Write the figure's title, on more lines if it is longer than the figure is wide."""
    figure.suptitle(title, size=TITLE_SIZE, weight="bold", color=INK, wrap=True)


def tidy(axes: Axes) -> None:
    """Leave only what helps to read the axes: two thin spines and small ticks."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(FAINT)
    axes.tick_params(colors=INK, color=FAINT, labelsize=NOTE_SIZE + 0.5)


def note(
    axes: Axes, text: str, at: tuple[float, float], units: tuple[str, str], colour: str = INK
) -> None:
    """Write small words just above and to the right of a point, readable on lines."""
    words = axes.annotate(
        text,
        at,
        (3, 3),
        xycoords=units,
        textcoords="offset points",
        size=NOTE_SIZE,
        color=colour,
        zorder=4,
    )
    words.set_path_effects([withStroke(linewidth=2.5, foreground=axes.get_facecolor())])


def legend(figure: Figure) -> None:
    """Name the lines at the right of the panel, on more lines if a name is long."""
    (axes,) = figure.axes
    lines, names = axes.get_legend_handles_labels()
    wrapped = ["\n".join(wrap(name, LEGEND_LETTERS)) for name in names]
    figure.legend(lines, wrapped, frameon=False, loc="outside right upper", fontsize=TEXT_SIZE)


def disable_mathtext(figure: Figure) -> None:
    """Have names drawn as they are, $ and all, and not as formulas, nor by LaTeX."""
    for text in figure.findobj(Text):
        text.set_usetex(False)
        text.set_parse_math(False)


def save(figure: Figure, path: Path) -> None:
    """Write a figure as a PNG or SVG in one step; the same figure always gives the same bytes.

    Raises:
        StoreError: the file cannot be written; an earlier file of that name is as it was.
    """
    disable_mathtext(figure)
    with atomic_write(path) as scratch, matplotlib.rc_context(SAVED):
        if path.suffix == ".svg":
            figure.savefig(scratch, format="svg", metadata={"Date": None, "Creator": PICTURE_MARK})
        else:
            canvas: Any = FigureCanvasAgg(figure)  # `savefig` would draw twice: to lay out, again
            canvas.print_png(scratch, metadata={"Software": PICTURE_MARK})
