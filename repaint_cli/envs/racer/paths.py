"""The paths of cars."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np

from repaint_cli.envs.episodes import EpisodePaths, Episodes
from repaint_cli.envs.paths import PathFormat


class RacerPaths(PathFormat):
    """Where the front points of cars on a track went."""

    records: ClassVar[tuple[str, ...]] = ("speed", "progress", "status")
    colours: ClassVar[Mapping[str, str]] = {"speed": "speed [m/s]", "reward": "reward per step"}

    def __init__(self, track: str) -> None:
        self._track = track

    def paths_of(
        self,
        valid: np.ndarray,
        records: Mapping[str, np.ndarray],
        observations: Callable[[], np.ndarray],
    ) -> EpisodePaths:
        """Return where the cars' front points were; see `PathFormat.paths_of`."""
        xy = np.stack([records["x"], records["y"]], -1)  # (T, S, E, 2)
        return EpisodePaths(np.moveaxis(xy, 0, 2))

    def draw(
        self, panels: Sequence[tuple[str, Episodes]], path: Path, title: str, colour: str
    ) -> None:
        """Draw the track with the cars' paths; see `PathFormat.draw`."""
        from repaint_cli.envs.racer.figures import draw_paths

        colour = colour or next(iter(self.colours))
        draw_paths(self._track, panels, path, title, (colour, self.colours[colour]))
