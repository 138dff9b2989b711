"""The pictures of a run: which data goes into its curves, its trajectories and its video."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from repaint_cli.activity import doing
from repaint_cli.envs.episodes import Episodes
from repaint_cli.report.curves import plot_curves
from repaint_cli.runs import evaluations
from repaint_cli.runs.reader import RecordedRun
from repaint_cli.tasks.task import Task

PANELS = 6
"""Checkpoints whose trajectories are drawn."""


def draw_run(run: RecordedRun) -> list[Path]:
    """Draw all figures of a run; return their files."""
    with doing("drawing"):
        return [path for draw in RUN_FIGURES for path in draw(run)]


def draw_returns(run: RecordedRun) -> list[Path]:
    """Draw a run's learning curve."""
    draw_curves({run.label: run}, run.files.curves, title=f"{run.task.name}: {run.label}")
    return [run.files.curves]


def draw_evaluations(run: RecordedRun) -> list[Path]:
    """Draw where some evaluations of the first seed led, if the task has paths."""
    files = list(run.files.kept_evaluations().items())
    if not files:
        return []
    chosen = np.unique(np.linspace(0, len(files) - 1, PANELS).round().astype(int))
    panels = [(f"iteration {k}", evaluations.read(path)) for k, path in (files[i] for i in chosen)]
    path = run.files.trajectories
    return [path] if draw_trajectories(run.task, panels, path, _first_seed(run)) else []


def draw_training(run: RecordedRun) -> list[Path]:
    """Draw what the run's logs show of its first seed's training, if the simulator has logs."""
    logs = run.task.env.logs
    if logs is None:
        return []
    return logs.draw_training(run.folder, run.seeds, run.progress, _first_seed(run))


RUN_FIGURES = (draw_returns, draw_evaluations, draw_training)
"""What is drawn of every run: functions from the run to the files that they wrote."""


def _first_seed(run: RecordedRun) -> str:
    return f"{run.task.name}: {run.label}, seed {run.seeds[0]}"


def draw_curves(
    runs: Mapping[str, RecordedRun], path: Path, title: str, target: float | None = None
) -> None:
    """Draw learning curves of runs on one task, by label, and what they were to reach."""
    some = list(runs.values())
    progress = {label: run.progress for label, run in runs.items() if run.progress is not None}
    scratch = [run.returns for run in some if run.method == "scratch"]
    taught = [run for run in some if run.record.teachers and run.method != "warm-start"]
    lengths = {run.taught_until for run in taught}
    best = float(np.nanmax(scratch[0].mean(0))) if scratch and len(some) > 1 else None
    mark = None if best is None else (best, "scratch's best")
    if target is not None and target != best:
        mark = (target, "target")
    plot_curves(
        {label: run.returns for label, run in runs.items()},
        path,
        title=title,
        progress=progress or None,
        reference=mark,
        transfer_iterations=lengths.pop() if len(lengths) == 1 else None,
    )


def draw_trajectories(
    task: Task,
    panels: Sequence[tuple[str, Episodes]],
    path: Path,
    title: str,
    colour: str = "",
) -> bool:
    """Draw the first seed's paths, a panel per evaluation; return False where the task has none.

    `colour` says what colours the paths; "" is the simulator's default.
    """
    panels = [panel for panel in panels if panel[1].paths is not None]
    if task.env.paths is None or not panels:
        return False
    task.env.paths.draw(panels, path, title, colour)
    return True
