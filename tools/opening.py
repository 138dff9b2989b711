"""README's picture: the curves of the lane pair, and how teacher, mirrored teacher, student drive.

    python tools/opening.py runs/transfer   # where benchmarks/transfer/judge-lanes.toml was run

Below the curves is the last frame's map of an episode of each policy on `racer-outer`, without
noise from the same start.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import EngFormatter, MaxNLocator

import repaint_cli
from repaint_cli.envs.racer.figures import filmed
from repaint_cli.envs.racer.film import MAP_WIDTH, racer_frames
from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.experiments.figures import ALONG, YLABELS
from repaint_cli.experiments.files import read_experiment
from repaint_cli.experiments.measures import interval_of_mean
from repaint_cli.experiments.planned import PlannedRun
from repaint_cli.experiments.planning import plan_experiment
from repaint_cli.report import style

ROOT = Path(__file__).parents[1]
PICTURE = ROOT / "docs" / "pictures" / "lanes.png"
EXPERIMENT, SCALE = ROOT / "benchmarks" / "transfer" / "judge-lanes.toml", "night"
TEACHER, TASK = "racer-inner", "racer-outer"
TITLE_HEIGHT = 40
"""Of a film's frame, pixels, where its title stands."""


def main(into: Path) -> None:
    """Draw the picture from runs below a folder."""
    planned = plan_experiment(read_experiment(str(EXPERIMENT)), SCALE, into)
    (panel,) = planned.panels
    figure = style.new_figure(10, 6.4)
    style.headline(figure, "An inner lane's driver teaches the outer lane: the opposite reward")
    upper, lower = figure.subfigures(2, 1, height_ratios=(1.1, 1))
    for axes, along in zip(upper.subplots(1, 2, sharey=True), ALONG, strict=True):
        _curves(axes, panel.runs, along)
    student = panel.runs["plain command"]
    drivers = {
        "the teacher, as it is": TEACHER,
        "the teacher's mirror image, untrained": f"{TEACHER}:mirrored",
        f"a student after {student.card.ppo.n_iterations} iterations": str(student.folder),
    }
    for axes, (name, policy) in zip(lower.subplots(1, 3), drivers.items(), strict=True):
        _lap(axes, name, policy)
    PICTURE.parent.mkdir(exist_ok=True)
    style.save(figure, PICTURE)


def _curves(axes: Axes, runs: dict[str, PlannedRun], along: str) -> None:
    """Draw the mean over seeds of each run, with its 95 % interval."""
    style.tidy(axes)
    axes.grid(axis="y", color="#e6e6e6", linewidth=0.7)
    colours = dict(zip(runs, ("#000000", "#0072B2"), strict=True))
    for name, planned in runs.items():
        run = planned.read()
        assert run is not None
        x = np.arange(1.0, run.returns.shape[1] + 1)
        if along == "steps":
            x = run.rows["env_steps"].mean(0)
        axes.plot(x, run.returns.mean(0), color=colours[name], label=name, linewidth=2)
        band = interval_of_mean(run.returns)
        if band:
            axes.fill_between(x, *band, color=colours[name], alpha=0.18, linewidth=0)
    axes.set_xlabel(ALONG[along], size=style.TEXT_SIZE)
    if along == "steps":
        axes.xaxis.set_major_formatter(EngFormatter(sep=" "))
    else:
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    if along == "iterations":
        axes.set_ylabel(YLABELS["return"], size=style.TEXT_SIZE)
        axes.legend(frameon=False, fontsize=style.TEXT_SIZE, loc="upper left")
    else:
        n = len(next(iter(runs.values())).seeds)
        text, units = f"mean of {n} seeds, 95 % interval", ("axes fraction", "axes fraction")
        style.note(axes, text, (0.55, 0.04), units)


def _lap(axes: Axes, name: str, policy: str) -> None:
    """Draw an episode's path on the track."""
    evaluation = repaint_cli.evaluate(
        policy, task=TASK, episodes=1, noise="none", keep_observations=True
    )
    track = load_track(evaluation.policies.card.env.tracks[0])  # type: ignore[attr-defined]
    episode = filmed(evaluation.episodes, 0)
    *_, last = racer_frames(track.inner, track.outer, track.centre, episode, "")
    axes.imshow(last[TITLE_HEIGHT:, :MAP_WIDTH])
    axes.set_title(name, size=style.TEXT_SIZE, weight="bold", color=style.INK)
    axes.set_axis_off()
    returns = evaluation.episodes.returns[0, 0]
    axes.text(
        0.5, -0.02, f"return {returns:.0f}".replace("-", "−"), transform=axes.transAxes,
        ha="center", va="top", size=style.TEXT_SIZE, color=style.INK,
    )  # fmt: skip


if __name__ == "__main__":
    main(Path(sys.argv[1]))
