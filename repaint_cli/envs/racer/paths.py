"""The paths of cars."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np

from repaint_cli.envs.episodes import EpisodePaths, Episodes
from repaint_cli.envs.paths import PathFormat
from repaint_cli.envs.racer.names import TRACK_RECORD


class RacerPaths(PathFormat):
    """Where the front points of cars on a track went."""

    colours: ClassVar[Mapping[str, str]] = {"speed": "speed [m/s]", "reward": "reward per step"}

    def __init__(self, tracks: Sequence[str], box_size: tuple[float, float] | None = None) -> None:
        self._tracks, self._box_size = tracks, box_size

    @property
    def records(self) -> tuple[str, ...]:
        """The records that `draw` shows; see `PathFormat.records`."""
        several = (TRACK_RECORD,) * (len(self._tracks) > 1)
        return "speed", "progress", "status", *several, *(("objects",) if self._box_size else ())

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
        """Draw each track with the cars' paths; see `PathFormat.draw`."""
        from repaint_cli.envs.racer.figures import draw_paths

        colour = colour or next(iter(self.colours))
        draw_paths(
            self._tracks, panels, path, title, (colour, self.colours[colour]), self._box_size
        )
