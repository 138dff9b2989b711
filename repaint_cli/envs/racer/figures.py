"""Which numbers of a race go into its figures and its film."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from repaint_cli.envs.episodes import Episodes
from repaint_cli.envs.racer.deepracer.simtrace_reader import read_training
from repaint_cli.envs.racer.deepracer.which_track import track_driven
from repaint_cli.envs.racer.dynamics.car import FRONT_OFFSET
from repaint_cli.envs.racer.dynamics.fleet import NOTHING
from repaint_cli.envs.racer.dynamics.objects import ObjectSettings
from repaint_cli.envs.racer.film import FilmedEpisode, racer_frames
from repaint_cli.envs.racer.names import STATUS, TRACK_RECORD
from repaint_cli.envs.racer.outcomes import parts
from repaint_cli.envs.racer.path_figure import plot_racer
from repaint_cli.envs.racer.road import Road, body_corners
from repaint_cli.envs.racer.simulator import RacerSimulator
from repaint_cli.envs.racer.track.files import load_tracks
from repaint_cli.envs.racer.track.geometry import Floats
from repaint_cli.envs.racer.track.track import Track
from repaint_cli.envs.racer.tracks import labels_of
from repaint_cli.envs.racer.training_figures import plot_heatmap, plot_progress
from repaint_cli.report.path_panels import PathPanel, label_of
from repaint_cli.report.video import Frame, write_video

MISHAPS = [STATUS.index(name) for name in ("off_track", "crashed", "immobilized", "reversed")]
MOST_LETTERS = 64
"""Of the title of a film, which is as wide as its map."""


def draw_paths(
    tracks: Sequence[str],
    panels: Sequence[tuple[str, Episodes]],
    path: Path,
    title: str,
    colour: tuple[str, str],
    box_size: tuple[float, float] | None = None,
) -> None:
    """Draw the first seed's paths over each track; see `PathFormat.draw`.

    `colour` is what colours them, "reward" or the name of a record, and its unit; `box_size` the
    length and width of boxes, where objects are boxes.
    """
    drawn, labels = [], labels_of(tracks)
    for name, episodes in panels:
        by_track = parts(episodes, 0, labels)
        own_by_label = by_track.episodes if by_track else {"": episodes.lengths[0] > 0}
        for label, own in own_by_label.items():
            panel = _panel(name, episodes, colour[0], own, label)
            if box_size and "objects" in episodes.records:
                panel = replace(panel, boxes=_boxes(episodes, own, box_size))
            drawn.append(panel)
    roads = [*map(_road_of, load_tracks(tracks))]
    plot_racer(drawn, roads, path, title, colour[1])


def _road_of(track: Track) -> Road:
    return Road(track.inner, track.outer, track.centre)


def _panel(
    name: str, episodes: Episodes, colour: str, own: np.ndarray, track: str = ""
) -> PathPanel:
    """Return the panel of some of the first seed's episodes, (E,) bool, on a track."""
    progress = episodes.progress
    assert episodes.paths is not None
    assert progress is not None
    label, xy = label_of(name, episodes.returns[0, own].mean(), track), episodes.paths[0, own]
    status = episodes.records["status"][:, 0].T[own]
    values = (episodes.rewards if colour == "reward" else episodes.records[colour])[:, 0]
    broken = xy.copy()
    broken[:, 1:][np.isin(status[:, :-1], MISHAPS)] = np.nan  # in a race the car is put back
    return PathPanel(
        broken,
        f"{label} · progress {progress[0, own].mean():.0f} %",
        values=values.T[own],
        exits=xy[status == STATUS.index("off_track")],
        crashes=xy[status == STATUS.index("crashed")],
    )


def _boxes(episodes: Episodes, own: np.ndarray, size: tuple[float, float]) -> Floats | None:
    """Return the corners of boxes (B, 4, 2) that stood alike in some episodes, (E,) bool, or None.

    `size` is their length and width, m.
    """
    poses = episodes.records["objects"][0, 0, own]  # (E, B, 3)
    if not (poses == poses[0]).all():
        return None
    return np.array([body_corners(x, y, heading, size) for x, y, heading in poses[0].tolist()])


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
    logged = [(k, episode) for k, episodes in read_training(log) for episode in episodes]
    training = [(k, episode.trace) for k, episode in logged]
    tracks, labels = load_tracks(env.tracks, env.waypoints), labels_of(env.tracks)
    several, heatmaps = len(tracks) > 1, []
    driven = np.array([track_driven(one, tracks) if several else 0 for _, one in logged])
    for t, (track, label) in enumerate(zip(tracks, labels, strict=True)):
        own = [training[i] for i in np.flatnonzero(driven == t)]
        name = f"heatmap-{label.replace('/', '-')}.png" if several else "heatmap.png"
        plot_heatmap(own, *_road_of(track), run / name, f"{title}, {label}" if several else title)
        heatmaps.append(run / name)
    curves = run / "progress.png"
    plot_progress(training, progress, curves, title)
    return [*heatmaps, curves]


def film(env: RacerSimulator, episodes: Episodes, path: Path, title: str, n_episodes: int) -> None:
    """Film the first seed's first episodes, each on its track; see `Simulator.film`."""
    roads, labels = [*map(_road_of, load_tracks(env.tracks))], labels_of(env.tracks)
    driven = episodes.last(TRACK_RECORD)

    def frames() -> Iterator[Frame]:
        for e in range(n_episodes):
            t = 0 if driven is None else int(driven[0, e])
            where = "" if driven is None else f" · {labels[t]}"
            end = f"{where} · episode {e + 1}"
            room = max(1, MOST_LETTERS - len(end))
            begin = title if len(title) <= room else f"{title[: room - 1]}…"
            yield from racer_frames(*roads[t], filmed(episodes, e, env.objects), begin + end)

    write_video(frames(), path, fps=15)


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
        box_size=objects.box_size[:2],
        are_boxes=objects.boxes,
    )
