"""A track on its own, from above: its lanes, its start line and which way it is driven. Metres."""

from pathlib import Path

import numpy as np

from repaint_cli.envs.checked_file import CheckedFile
from repaint_cli.envs.racer.road import draw_road, lane_patches
from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.envs.racer.track.track import Track
from repaint_cli.files.commands import command
from repaint_cli.report import style

ARROWS = 6
WIDTH = 6.0  # inches


def plot_track(track: Track, path: Path, facts: str) -> None:
    """Draw a track.

    Args:
        track: which.
        path: of the PNG.
        facts: under its name.

    Raises:
        StoreError: the file cannot be written.
    """
    edge, _ = track.outline
    low, high = edge.min(0) - 0.3, edge.max(0) + 0.3
    width, height = high - low
    figure = style.new_figure(WIDTH, 1.7 + (WIDTH - 1) * float(np.clip(height / width, 0.1, 1.6)))
    style.headline(figure, track.name)
    axes = figure.subplots()
    axes.set_title(facts, size=style.NOTE_SIZE, color=style.INK)
    draw_road(axes, track.inner, track.outer, track.centre)
    (point,), (heading,) = track.pose_at(np.zeros(1))
    across = track.width / 2 * np.array([-np.sin(heading), np.cos(heading)])
    line = np.stack([point - across, point + across])
    axes.plot(*line.T, color="#D55E00", linewidth=2, zorder=3)
    shares = (np.arange(ARROWS) + 0.5) / ARROWS
    points, headings = track.pose_at(shares)
    ways = np.stack([np.cos(headings), np.sin(headings)], axis=1)
    axes.quiver(
        points[:, 0], points[:, 1], ways[:, 0], ways[:, 1],
        zorder=3, color=style.INK, angles="xy", scale=18, width=0.006, pivot="mid",
    )  # fmt: skip
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal")
    style.tidy(axes)
    start = axes.plot([], [], color="#D55E00", linewidth=2, label="start line")[0]
    figure.legend(
        handles=[*lane_patches(), start], loc="outside lower center", ncols=3, frameon=False,
        fontsize=style.NOTE_SIZE,
    )  # fmt: skip
    style.save(figure, path)


def facts_of(track: Track) -> str:
    """Return how long and wide a track is, and how it is driven, for people."""
    radius = track.tightest_radius
    way = "counter-clockwise" if track.ccw else "clockwise"
    return (
        f"{track.length:.2f} m long, {track.width:.3f} m wide, "
        f"{f'driven {way}' if track.closed else 'open'}, "
        f"{f'tightest radius {radius:.2f} m' if radius < 100 else 'straight'}"
    )


def check_track(file: str) -> CheckedFile:
    """Check a file of waypoints and describe its track.

    Raises:
        NotFound: the file does not exist.
        CardError: the file holds no track.
    """
    track = load_track(file)
    facts = facts_of(track)
    picture = Path(f"{track.name}.png")
    return CheckedFile(
        track.name, facts, picture, lambda: plot_track(track, picture, facts),
        command("repaint train-teacher --task racer-inner --set {}", f"env.track={file}"),
        track.note,
    )  # fmt: skip
