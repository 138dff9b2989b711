"""Performance profiles: which share of a run's seeds ended at least at a score."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from repaint_cli.report import style
from repaint_cli.report.statistics import Floats

WIDTH, HEIGHT = 9.4, 4.0


def profile(scores: Sequence[float]) -> tuple[Floats, Floats]:
    """Return scores τ, ascending, and which share of the seeds is at least there, (S,) each."""
    ordered = np.sort(np.asarray(scores, np.float64))
    return ordered, 1 - np.searchsorted(ordered, ordered, side="left") / len(ordered)


def plot_profiles(scores: Mapping[str, Sequence[float]], path: Path, *, title: str) -> None:
    """Draw the profile of each run.

    Args:
        scores: label → the score of each seed, (S,).
        path: of the PNG or SVG.
        title: over the figure.

    Raises:
        StoreError: the file cannot be written.
    """
    figure, axes = style.one_panel(WIDTH, HEIGHT, title)
    colours = style.colours_of(scores)
    low = min(min(each) for each in scores.values())
    high = max(max(each) for each in scores.values())
    room = (high - low) * 0.05 or 1.0
    for label, each in scores.items():
        at, share = profile(each)
        # the share holds up to its score, and falls behind it
        axes.step(
            [low - room, *at, at[-1], high + room], [1, *share, 0, 0], where="pre",
            color=colours[label], linewidth=2.1, label=label,
        )  # fmt: skip
    axes.set_xlim(low - room, high + room)
    axes.set_ylim(-0.02, 1.05)
    axes.set_xlabel("score τ: mean return of the last evaluation", size=style.TEXT_SIZE)
    axes.set_ylabel("share of seeds at or above τ", size=style.TEXT_SIZE)
    style.legend(figure)
    style.save(figure, path)
