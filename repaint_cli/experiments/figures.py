"""The figures of an experiment: a panel a task, by iterations and by environment steps."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from repaint_cli.activity import doing
from repaint_cli.experiments.folder import ExperimentFolder
from repaint_cli.experiments.measures import interval_of_mean, smoothed, target_of
from repaint_cli.experiments.planned import PlannedExperiment
from repaint_cli.experiments.results import MeasuredPanel
from repaint_cli.experiments.schema import Experiment
from repaint_cli.report.panels import MOST_THIN, CurvePanel, Line, plot_panels
from repaint_cli.runs.compare import EPISODES, compare_paths

SUFFIXES = (".png", ".svg")
ALONG = {"iterations": "iteration", "steps": "environment steps of a seed"}
"""What curves are drawn along, and what that axis is called."""
YLABELS = {"return": "mean evaluation return", "progress": "lap progress [%]"}
SMOKE_EPISODES = 2
"""Paths of each policy at the scale smoke."""


def draw(
    planned: PlannedExperiment, panels: Sequence[MeasuredPanel], folder: ExperimentFolder
) -> list[Path]:
    """Draw an experiment's figures; return their files.

    Raises:
        StoreError: a file cannot be written.
    """
    experiment = planned.experiment
    with doing(f"drawing {experiment.name}"):
        if experiment.figure == "trajectories":
            return [draw_paths(planned, folder)]
        if experiment.figure == "none":
            return []
        return draw_curves(experiment, panels, folder, _seeds(panels), planned.scale)


def draw_curves(
    experiment: Experiment, panels: Sequence[MeasuredPanel], folder: ExperimentFolder,
    seeds: str, scale: str,
) -> list[Path]:  # fmt: skip
    """Draw learning curves, as PNG and SVG, along iterations and along steps."""
    over = experiment.smoothing
    more = [f"smoothed over {over} iterations"] * (over > 1)
    more += ["smoke: no result"] * (scale == "smoke")
    title = f"{experiment.summary.rstrip('.')} ({experiment.item})\n{'; '.join(more)}".rstrip()
    rows = [[_panel(own, measure, over) for own in panels] for measure in experiment.show]
    banded = any(line.band for row in rows for panel in row for line in panel.lines)
    few = 1 < max(len(run.seeds) for own in panels for run in own.runs.values()) <= MOST_THIN
    note = f"bold: mean of {seeds}" + "; thin: each seed" * few
    note += "; shaded: 95 % interval of the mean" if banded else ""
    written = []
    for along in ALONG:
        paths = [folder.figure(along, suffix) for suffix in SUFFIXES]
        shown = [[_along(panel, along) for panel in row] for row in rows]
        plot_panels(shown, paths, title=title, note=note)
        written += paths
    return written


def _seeds(panels: Sequence[MeasuredPanel]) -> str:
    counts = sorted({len(run.seeds) for own in panels for run in own.runs.values()})
    return f"{'-'.join(map(str, counts))} seed{'s' * (counts != [1])}"


def _panel(own: MeasuredPanel, measure: str, over: int) -> CurvePanel:
    """Return a panel of curves along environment steps."""
    lines = []
    for variant, run in own.runs.items():
        values = run.returns if measure == "return" else run.progress
        if values is not None:
            y = smoothed(values, over)
            lines.append(Line(variant, run.rows["env_steps"], y, interval_of_mean(y)))
    target = target_of(own) if measure == "return" else None
    name, percent = own.panel.title, measure == "progress"
    return CurvePanel(name, tuple(lines), ALONG["steps"], YLABELS[measure], target, percent)


def _along(panel: CurvePanel, along: str) -> CurvePanel:
    """Return a panel along iterations or steps."""
    if along == "steps":
        return panel
    lines = tuple(
        replace(line, x=np.broadcast_to(np.arange(1.0, line.y.shape[1] + 1), line.y.shape))
        for line in panel.lines
    )
    return replace(panel, lines=lines, xlabel=ALONG[along])


def draw_paths(planned: PlannedExperiment, folder: ExperimentFolder) -> Path:
    """Let the last policies play, and draw the first seeds' paths."""
    runs = [run for own in planned.panels for run in own.runs.values()]
    path = folder.figure("trajectories", ".png")
    episodes = SMOKE_EPISODES if planned.scale == "smoke" else EPISODES
    compare_paths([run.folder for run in runs], path, replace=True, episodes=episodes)
    return path
