"""Which numbers of a race go into its figures and its film."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from repaint_cli.envs.episodes import Episodes
from repaint_cli.envs.racer.deepracer.simtrace_reader import read_training
from repaint_cli.envs.racer.dynamics.car import FRONT_OFFSET
from repaint_cli.envs.racer.dynamics.fleet import NOTHING
from repaint_cli.envs.racer.dynamics.objects import ObjectSettings
from repaint_cli.envs.racer.film import CAR_SIZE, FilmedEpisode, racer_frames
from repaint_cli.envs.racer.names import STATUS
from repaint_cli.envs.racer.path_figure import plot_racer
from repaint_cli.envs.racer.simulator import RacerSimulator
from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.envs.racer.training_figures import plot_heatmap, plot_progress
from repaint_cli.report.path_panels import PathPanel, label_of
from repaint_cli.report.video import write_video


def draw_paths(
    track: str,
    panels: Sequence[tuple[str, Episodes]],
    path: Path,
    title: str,
    colour: tuple[str, str],
) -> None:
    """Draw the first seed's paths over a track; see `PathFormat.draw`.

    `colour` is what colours them, "reward" or the name of a record, and its unit.
    """
    drawn = [_panel(name, episodes, colour[0]) for name, episodes in panels]
    road = load_track(track)
    plot_racer(drawn, road.inner, road.outer, road.centre, path, title, colour[1])


def _panel(name: str, episodes: Episodes, colour: str) -> PathPanel:
    progress, status = episodes.progress, episodes.status
    assert episodes.paths is not None
    assert progress is not None
    assert status is not None
    label = label_of(name, episodes.returns[0].mean())
    return PathPanel(
        episodes.paths[0],
        f"{label} · progress {progress[0].mean():.0f} %",
        values=(episodes.rewards if colour == "reward" else episodes.records[colour])[:, 0].T,
        ended_off=status[0] == STATUS.index("off_track"),
        crashed=status[0] == STATUS.index("crashed"),
    )


def draw_training(
    env: RacerSimulator, run: Path, log: Path, progress: np.ndarray, title: str
) -> list[Path]:
    """Draw where a seed's car drove in training and how far it came; return the pictures.

    Args:
        env: what was driven.
        run: the run's folder.
        log: the seed's log in it.
        progress: mean progress of each evaluation, (K,) in %.
        title: over both.
    """
    training = [(k, trace) for k, traces in read_training(log) for trace in traces]
    track = load_track(env.track)
    heatmap, curves = run / "heatmap.png", run / "progress.png"
    plot_heatmap(training, track.inner, track.outer, track.centre, heatmap, title)
    plot_progress(training, progress, curves, title)
    return [heatmap, curves]


def film(env: RacerSimulator, episodes: Episodes, path: Path, title: str, n_episodes: int) -> None:
    """Film the first seed's first episodes; see `Simulator.film`."""
    track = load_track(env.track)
    frames = (
        frame
        for e in range(n_episodes)
        for frame in racer_frames(
            track.inner,
            track.outer,
            track.centre,
            filmed(episodes, e, env.objects),
            f"{title} · episode {e + 1}",
        )
    )
    write_video(frames, path, fps=15)


def filmed(episodes: Episodes, e: int, objects: ObjectSettings = NOTHING) -> FilmedEpisode:
    """Return an episode of the first seed as it is filmed; its observations were kept."""
    assert episodes.observations is not None
    observed = episodes.observations[0][e]
    images, ranges = observed, None
    if isinstance(observed, dict):
        images, ranges = observed["camera"], observed["lidar"]
    steps = episodes.lengths[0, e]
    state = {name: rows[:steps, 0, e] for name, rows in episodes.records.items()}
    ahead = FRONT_OFFSET * np.stack([np.cos(state["heading"]), np.sin(state["heading"])], -1)
    return FilmedEpisode(
        xy=np.stack([state["x"], state["y"]], -1) - ahead,
        heading=state["heading"],
        speed=state["speed"],
        steering=state["steering"],
        progress=state["progress"],
        reward=episodes.rewards[:steps, 0, e],
        images=images[..., 0],
        ranges=np.empty((steps, 0)) if ranges is None else ranges,
        objects=state.get("objects", np.empty((steps, 0, 3))),
        object_size=objects.box_size[:2] if objects.boxes else CAR_SIZE,
        are_boxes=objects.boxes,
    )
