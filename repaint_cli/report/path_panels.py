"""Figures of evaluated episodes' paths, a panel an evaluation: what they have in common. Metres.

**E** episodes · **T** steps.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from repaint_cli.report import style
from repaint_cli.report.markers import Marker
from repaint_cli.report.statistics import Floats

MAX_COLUMNS, PLACE_COLUMNS = 3, 4
LEAST_SPAN = 0.1
"""Of a scale, as a share of its largest number, so that noise does not look like a trend."""
FEW_VALUES = 8
"""So many different values are shown without cutting off the outer ones."""
TALL = 10.0
"""Height of a figure above which its colour bar grows longer but not wider, inches."""
LONG_NAME = 24
"""Letters of a name that has a line of its own over its panel."""


@dataclass(frozen=True)
class PathPanel:
    """The paths of one evaluation: one panel."""

    xy: Floats
    """Positions (E, T, 2), m; nan after an episode's end, and where a path is broken."""
    label: str
    """Over the panel: "iteration 5 · return 212 · progress 63 %"."""
    values: Floats | None = None
    """What colours the steps, (E, T), such as speed or reward; nan after an episode's end."""
    target: Floats | None = None
    """Where each episode's path should lead, (E, 2), m."""
    exits: Floats | None = None
    """Where the track was left, (P, 2), m."""
    crashes: Floats | None = None
    """Where there was a crash, (P, 2), m."""
    boxes: Floats | None = None
    """Corners of what stood at the same place in all episodes, (B, 4, 2), m."""

    def __post_init__(self) -> None:
        n_episodes, n_steps, two = self.xy.shape
        wanted = {
            "values": (n_episodes, n_steps),
            "target": (n_episodes, 2),
        }
        for name, shape in wanted.items():
            array = getattr(self, name)
            if two != 2 or (array is not None and np.shape(array) != shape):
                raise ValueError(f"{name} is {np.shape(array)} beside paths {self.xy.shape}")


def label_of(name: str, mean_return: float, place: str = "") -> str:
    """Return the label of a panel: its name and the mean return; of several places, where."""
    whole = f"{place}: {name}" if place else name
    between = chr(10) if place or len(name) > LONG_NAME else " · "
    return f"{whole}{between}return {mean_return:.4g}"


def grid(n_panels: int, aspect: float, title: str, n_places: int = 1) -> tuple[Figure, list[Axes]]:
    """Return a figure with so many panels of about height/width `aspect`, at most three a row.

    Those of several places, such as tracks, have axes of their own, and a column or two a place.
    """
    aspect, one_place = float(np.clip(aspect, 0.4, 1.4)), n_places == 1
    columns = 2 if n_panels == 4 else max(1, min(n_panels, MAX_COLUMNS))
    if 1 < n_places <= PLACE_COLUMNS:
        columns = min(n_panels, PLACE_COLUMNS // n_places * n_places)
    rows = max(1, -(-n_panels // columns))
    side = {1: 5.6, 2: 4.3}.get(columns, 3.6)
    figure = style.new_figure(columns * side + 1.2, rows * (side * aspect + 0.35) + 1.1)
    style.headline(figure, title)
    places = figure.subplots(rows, columns, squeeze=False, sharex=one_place, sharey=one_place)
    places = places.ravel()
    for empty in places[n_panels:]:
        empty.set_visible(False)
    for i, axes in enumerate(places[:n_panels]):
        is_last = i + columns >= n_panels
        axes.tick_params(labelbottom=is_last or not one_place)
        axes.set_xlabel("x [m]" if is_last else "", size=style.NOTE_SIZE)
        axes.set_ylabel("y [m]" if i % columns == 0 else "", size=style.NOTE_SIZE)
    return figure, list(places[:n_panels])


def frame(axes: Axes, label: str, low: Floats, high: Floats) -> None:
    """Name a panel and show what lies between two corners (2,), m, at the same scale both ways."""
    style.tidy(axes)
    axes.set_title(label, size=style.TEXT_SIZE - 0.5, color=style.INK)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])


def scale_of(panels: Sequence[PathPanel]) -> tuple[Normalize, str]:
    """Return one scale for all panels, without the outer 2 % of many values, and what overflows."""
    known = [np.ravel(panel.values) for panel in panels if panel.values is not None]
    values = np.concatenate([*known, np.empty(0)])
    values = values[np.isfinite(values)]
    if len(values) == 0:
        return Normalize(0, 1), "neither"
    bounds = [2, 98] if len(np.unique(values)) > FEW_VALUES else [0, 100]
    low, high = (float(end) for end in np.percentile(values, bounds))
    least = LEAST_SPAN * max(abs(low), abs(high)) or 1.0
    if high - low < least:
        low, high = low - least / 2, high + least / 2
    below, above = bool(values.min() < low), bool(values.max() > high)
    return Normalize(low, high), {(1, 1): "both", (1, 0): "min", (0, 1): "max"}.get(
        (below, above), "neither"
    )


def coloured_paths(axes: Axes, xy: Floats, values: Floats | None, scale: Normalize) -> None:
    """Draw every step as a short line in the colour of its value; nan ends a path."""
    segments = np.stack([xy[:, :-1], xy[:, 1:]], axis=2).reshape(-1, 2, 2)  # (E·(T−1), 2, 2)
    whole = np.isfinite(segments).all(axis=(1, 2))
    lines = LineCollection(list(segments[whole]), linewidths=1.0, capstyle="round", zorder=3)
    if values is None:
        lines.set_color(style.METHOD_COLOURS["repaint"])
    else:
        lines.set(array=values[:, 1:].reshape(-1)[whole], cmap=style.ramp(), norm=scale)
    axes.add_collection(lines, autolim=False)


def ends_of(xy: Floats) -> Floats:
    """Return the last known point of each episode that has one, else nan, (E, 2)."""
    known = ~np.isnan(xy[:, :, 0])  # (E, T)
    last = known.shape[1] - 1 - np.argmax(known[:, ::-1], axis=1)
    return np.asarray(xy[np.arange(len(xy)), last])


def mark(axes: Axes, points: Floats, marker: Marker) -> None:
    """Put a marker at each of some points, (E, 2)."""
    axes.plot(*points.T, linestyle="none", zorder=5, **marker)


def colour_bar(figure: Figure, grid: list[Axes], scale: Normalize, label: str, extend: str) -> None:
    """Draw the scale of a quantity beside all panels, with its name and unit."""
    slender = 28 * max(1.0, figure.get_figheight() / TALL)
    bar = figure.colorbar(
        ScalarMappable(scale, style.ramp()), ax=grid, extend=extend, shrink=0.8, aspect=slender,
        pad=0.02,
    )  # fmt: skip
    bar.set_label(label, size=style.TEXT_SIZE)
    bar.ax.tick_params(labelsize=style.NOTE_SIZE)
    bar.outline.set_visible(False)
