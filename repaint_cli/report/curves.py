"""Learning curves: evaluated mean returns over iterations, a line a method, with every seed."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from repaint_cli.report import style
from repaint_cli.report.statistics import Floats, t_interval

WIDTH, HEIGHT = 7.6, 4.4
LABEL_GAP = 0.055
"""Least distance between the names at the ends of the lines, as a share of the panel's height."""


def plot_curves(
    returns: Mapping[str, ArrayLike], path: Path, *, title: str,
    ylabel: str = "mean evaluation return", progress: Mapping[str, ArrayLike] | None = None,
    reference: tuple[float, str] | None = None, transfer_iterations: int | None = None,
) -> None:  # fmt: skip
    """Draw each method's learning curve: its mean, every seed, and the interval of the mean.

    The mean is drawn where every seed of the method has a value; a seed that stopped early ends
    the mean, but not the other seeds' thin lines.

    Args:
        returns: label → evaluated mean returns (S, K) at iterations 1 … K; nan where not evaluated.
        path: of the PNG.
        title: over the whole figure.
        ylabel: what the return is, with its unit.
        progress: label → lap progress in per cent (S, K), for a second panel.
        reference: a dashed horizontal line and its name, such as scratch's best return.
        transfer_iterations: the first iterations, in which the teacher took part, are shaded.

    Raises:
        StoreError: the file cannot be written.
    """
    curves = {label: _seeds(values) for label, values in returns.items()}
    figure = style.new_figure(WIDTH, HEIGHT * (1.75 if progress else 1))
    style.headline(figure, title)
    figure.supxlabel(_note(curves), size=style.NOTE_SIZE, color="#555555")
    panels = figure.subplots(2 if progress else 1, 1, squeeze=False, sharex=True)[:, 0]
    _panel(panels[0], curves, ylabel, transfer_iterations)
    if transfer_iterations:
        style.note(panels[0], "with the teacher", (0.5, 1), ("data", "axes fraction"), "#6b6550")
    if reference:
        _reference(panels[0], *reference)
    if progress:
        _progress_panel(panels[1], progress, transfer_iterations)
    for axes in panels:
        _name_lines(axes)
    panels[-1].set_xlabel("iteration", size=style.TEXT_SIZE)
    style.save(figure, path)


def _progress_panel(
    axes: Axes, progress: Mapping[str, ArrayLike], transfer_iterations: int | None
) -> None:
    """Draw each method's lap progress, label → (S, K) in per cent."""
    curves = {label: _seeds(values) for label, values in progress.items()}
    _panel(axes, curves, "mean lap progress [%]", transfer_iterations)
    axes.set_ylim(-3, 103)


def _seeds(values: ArrayLike) -> Floats:
    """Return (S, K) without the seeds that have no value at all."""
    curves = np.atleast_2d(np.asarray(values, dtype=np.float64))
    return curves[~np.isnan(curves).all(axis=1)]


def _note(curves: Mapping[str, Floats]) -> str:
    """Explain the lines, and name the number of seeds."""
    counts = sorted({len(seeds) for seeds in curves.values()})
    if counts in ([], [0]):
        return "no evaluation yet"
    if counts[-1] == 1:
        return "one seed a line"
    many = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
    band = "; shaded: 95 % interval of the mean" if counts[-1] >= 3 else ""
    return f"bold: mean of {many} seeds; thin: each seed{band}"


def _panel(
    axes: Axes,
    curves: Mapping[str, Floats],
    ylabel: str,
    transfer_iterations: int | None,
) -> None:
    style.tidy(axes)
    colours = style.colours_of(curves)
    if transfer_iterations:
        axes.axvspan(0.5, transfer_iterations + 0.5, color="#f3f0e6", linewidth=0, zorder=0)
    for label, seeds in curves.items():
        _curve(axes, seeds, colours[label], label)
    if not any(len(seeds) for seeds in curves.values()):
        axes.set_yticks([])
    longest = max([1, *(seeds.shape[1] for seeds in curves.values())])
    axes.set_xlim(0.5, longest + 0.5)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1, steps=[1, 2, 5, 10]))
    axes.set_ylabel(ylabel, size=style.TEXT_SIZE)
    axes.grid(axis="y", color="#e6e6e6", linewidth=0.7)
    axes.set_axisbelow(True)


def _curve(axes: Axes, seeds: Floats, colour: str, label: str) -> None:
    """Draw one method: thin seeds, a band if three or more of them, the mean on top."""
    iterations = np.arange(1, seeds.shape[1] + 1)
    if len(seeds) > 1:
        for seed in seeds:
            at = ~np.isnan(seed)
            axes.plot(iterations[at], seed[at], color=colour, alpha=0.35, linewidth=0.7)
    whole = ~np.isnan(seeds).any(axis=0) if len(seeds) else np.zeros(seeds.shape[1], bool)
    if len(seeds) >= 3:
        _, low, high = t_interval(seeds[:, whole])
        axes.fill_between(iterations[whole], low, high, color=colour, alpha=0.15, linewidth=0)
    marker = "o" if 0 < whole.sum() <= 2 else None
    mean = seeds[:, whole].mean(axis=0) if len(seeds) else np.empty(0)
    axes.plot(
        iterations[whole], mean, color=colour, linewidth=2.1, marker=marker, label=label, zorder=3
    )


def _reference(axes: Axes, value: float, name: str) -> None:
    """Draw a dashed line with its name at the left, where learning curves are low."""
    axes.axhline(value, color=style.INK, linewidth=1, linestyle=(0, (5, 3)), zorder=1)
    style.note(axes, name, (0, value), ("axes fraction", "data"))


def _name_lines(axes: Axes) -> None:
    """Write each method's name beside the end of its mean, apart from one another."""
    lines = [line for line in axes.lines if not str(line.get_label()).startswith("_")]
    drawn = {line: np.asarray(line.get_xydata()) for line in lines}
    ends = {line: points[-1] for line, points in drawn.items() if len(points)}
    bottom, top = axes.get_ylim()
    ordered = sorted(ends, key=lambda line: float(ends[line][1]))
    heights = [(float(ends[line][1]) - bottom) / (top - bottom) for line in ordered]
    for line, height in zip(ordered, spread(heights, LABEL_GAP), strict=True):
        colour = str(line.get_color())
        axes.annotate(
            str(line.get_label()),
            tuple(ends[line]),
            (1.025, height),
            textcoords="axes fraction",
            va="center",
            size=style.TEXT_SIZE,
            color=style.darker(colour),
            arrowprops={
                "arrowstyle": "-",
                "linestyle": ":",
                "color": colour,
                "relpos": (0, 0.5),
                "shrinkA": 1,
                "shrinkB": 2,
            },
        )


def spread(places: Sequence[float], gap: float) -> list[float]:
    """Move ascending places at least `gap` apart, each as little as possible (least squares).

    Neighbours that are too close become a block around the mean of its members, again and again.
    """
    blocks: list[list[float]] = []  # of each place less the room of those before it
    for i, place in enumerate(places):
        blocks.append([place - i * gap])
        while len(blocks) > 1 and np.mean(blocks[-2]) > np.mean(blocks[-1]):
            blocks[-2:] = [blocks[-2] + blocks[-1]]
    shared = [float(np.mean(block)) for block in blocks for _ in block]
    return [place + i * gap for i, place in enumerate(shared)]
