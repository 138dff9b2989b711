"""The pictures of a run: which data goes into its curves, its trajectories and its video."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from repaint_cli.envs.gymnasium.film import Episode, render_gym
from repaint_cli.envs.gymnasium.reacher import plot_reacher
from repaint_cli.envs.racer.deepracer.simtrace import log_folders, read_training
from repaint_cli.envs.racer.film import NOSE, Drive, racer_frames
from repaint_cli.envs.racer.path_figure import plot_racer
from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.envs.racer.training_figures import plot_heatmap, plot_progress
from repaint_cli.envs.simulator import GymEnv, RacerEnv
from repaint_cli.learn.evaluation import Episodes
from repaint_cli.learn.rollout.observations import arrays_of
from repaint_cli.report.curves import plot_curves
from repaint_cli.report.paths import Paths
from repaint_cli.report.video import write_video
from repaint_cli.runs import evaluations
from repaint_cli.runs.reader import Run
from repaint_cli.tasks.task import TaskCard

Colour = Literal["speed", "reward"]
UNITS: dict[Colour, str] = {"speed": "speed [m/s]", "reward": "reward per step"}

LONG = 24
"""Letters of a name that has a line of its own over its panel."""
PANELS = 6
"""Checkpoints whose trajectories are drawn."""


def draw_run(run: Run) -> list[Path]:
    """Draw a run's learning curve and, where the task has paths, its first seed's trajectories."""
    curves = run.folder / "curves.png"
    draw_curves({run.label: run}, curves, title=f"{run.task.name}: {run.label}")
    title = f"{run.task.name}: {run.label}, seed {run.record['seeds'][0]}"
    return [curves, *_draw_evaluations(run, title), *_draw_training(run, title)]


def _draw_evaluations(run: Run, title: str) -> list[Path]:
    """Draw where some of the evaluations led."""
    kept = list(evaluations.kept(run.folder))
    if not kept:
        return []
    chosen = np.unique(np.linspace(0, len(kept) - 1, PANELS).round().astype(int))
    ks = [kept[i] for i in chosen]
    panels = [(f"iteration {k}", evaluations.read(run.folder, k)) for k in ks]
    trajectories = run.folder / "trajectories.png"
    return [trajectories] if draw_trajectories(run.task, panels, trajectories, title) else []


def _draw_training(run: Run, title: str) -> list[Path]:
    """Draw where a racing run's first seed drove in training and how far; return the pictures."""
    if not isinstance(run.task.env, RacerEnv) or run.progress is None:
        return []
    log = log_folders(run.folder, run.record["seeds"])[0]
    drives = [(k, trace) for k, traces in read_training(log) for trace in traces]
    track = load_track(run.task.env.track)
    heatmap, progress = run.folder / "heatmap.png", run.folder / "progress.png"
    plot_heatmap(drives, track.inner, track.outer, track.centre, heatmap, title)
    plot_progress(drives, run.progress[0], progress, title)
    return [heatmap, progress]


def draw_curves(runs: dict[str, Run], path: Path, title: str, target: float | None = None) -> None:
    """Draw learning curves of runs on one task, by label, and what they were to reach."""
    some = list(runs.values())
    progress = {label: run.progress for label, run in runs.items() if run.progress is not None}
    scratch = [run.returns for run in some if run.method == "scratch"]
    taught = [run for run in some if run.record["teachers"] and run.method != "warm-start"]
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
    task: TaskCard,
    panels: Sequence[tuple[str, Episodes]],
    path: Path,
    title: str,
    colour: Colour = "speed",
) -> bool:
    """Draw the first seed's paths, a panel per evaluation; return False where the task has none.

    `colour` says what colours the paths of a race.
    """
    paths = [_paths(label, played, colour) for label, played in panels if played.paths is not None]
    if not paths:
        return False
    if isinstance(task.env, RacerEnv):
        track = load_track(task.env.track)
        plot_racer(paths, track.inner, track.outer, track.centre, path, title, UNITS[colour])
    else:
        plot_reacher(paths, path, title)
    return True


def _paths(label: str, played: Episodes, colour: Colour) -> Paths:
    assert played.paths is not None
    label += "\n" if len(label) > LONG else " · "
    label += f"return {played.returns[0].mean():.4g}"
    if played.progress is None or played.status is None:
        targets = None if played.targets is None else played.targets[0]
        return Paths(played.paths[0], label, target=targets)
    from repaint_cli.envs.racer.dynamics.rules import STATUS

    return Paths(
        played.paths[0],
        f"{label} · progress {played.progress[0].mean():.0f} %",
        values=(played.rewards if colour == "reward" else played.records["speed"])[:, 0].T,
        ended_off=played.status[0] == STATUS.index("off_track"),
        crashed=played.status[0] == STATUS.index("crashed"),
    )


def film(task: TaskCard, played: Episodes, path: Path, title: str, n_episodes: int) -> None:
    """Film the first seed's first episodes.

    Raises:
        RenderError: MuJoCo's renderer does not work here.
        StoreError: the file cannot be written.
    """
    if isinstance(task.env, GymEnv):
        episodes = [_replay(played, e) for e in range(n_episodes)]
        return render_gym(task.env.id, task.env.kwargs, episodes, path, title=title)
    track = load_track(task.env.track)
    frames = (
        frame
        for e in range(n_episodes)
        for frame in racer_frames(
            track.inner, track.outer, track.centre, _drive(played, e), f"{title} · episode {e + 1}"
        )
    )
    return write_video(frames, path, fps=15)


def _replay(played: Episodes, e: int) -> Episode:
    steps = played.lengths[0, e]
    actions = played.actions[:steps, 0, e]
    rewards = played.rewards[:steps, 0, e]
    return Episode(played.env_seeds[e], actions, rewards)


def _drive(played: Episodes, e: int) -> Drive:
    assert played.sights is not None
    images, *ranges = arrays_of(played.sights[0][e])
    steps = played.lengths[0, e]
    state = {name: rows[:steps, 0, e] for name, rows in played.records.items()}
    ahead = NOSE * np.stack([np.cos(state["heading"]), np.sin(state["heading"])], -1)
    return Drive(
        xy=np.stack([state["x"], state["y"]], -1) - ahead,
        heading=state["heading"],
        speed=state["speed"],
        steering=state["steering"],
        progress=state["progress"],
        reward=played.rewards[:steps, 0, e],
        images=images[..., 0],
        ranges=ranges[0] if ranges else np.empty((steps, 0)),
        bots=state.get("bots", np.empty((steps, 0, 3))),
    )
