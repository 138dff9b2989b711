"""Paths in Gymnasium's environments: of Reacher's fingertip, or of a card's position."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from repaint_cli.envs.episodes import EpisodePaths, Episodes
from repaint_cli.envs.paths import PathFormat


class ReacherPaths(PathFormat):
    """Where the fingertip went, and its targets."""

    def paths_of(
        self,
        valid: np.ndarray,
        records: Mapping[str, np.ndarray],
        observations: Callable[[], np.ndarray],
    ) -> EpisodePaths:
        """Return the fingertip and its targets; see `PathFormat.paths_of`."""
        obs = observations()  # (S, T+1, E, O)
        target, gap = obs[..., 4:6], obs[..., 8:10]  # the gap is fingertip − target
        known = np.concatenate([valid[:1], valid]).transpose(1, 0, 2)[..., None]
        positions = np.where(known, target + gap, np.nan).transpose(0, 2, 1, 3)
        return EpisodePaths(positions, target[:, 0])

    def draw(
        self, panels: Sequence[tuple[str, Episodes]], path: Path, title: str, colour: str
    ) -> None:
        """Draw the fingertip's paths in the arm's plane; see `PathFormat.draw`."""
        from repaint_cli.envs.gymnasium.reacher import plot_reacher
        from repaint_cli.report.path_panels import PathPanel, label_of

        drawn = []
        for name, episodes in panels:
            assert episodes.paths is not None
            assert episodes.targets is not None
            label = label_of(name, episodes.returns[0].mean())
            drawn.append(PathPanel(episodes.paths[0], label, target=episodes.targets[0]))
        plot_reacher(drawn, path, title)


class PositionPaths(PathFormat):
    """Where two numbers of the infos went."""

    def __init__(self, names: tuple[str, str]) -> None:
        self.names = names

    def paths_of(
        self,
        valid: np.ndarray,
        records: Mapping[str, np.ndarray],
        observations: Callable[[], np.ndarray],
    ) -> EpisodePaths:
        """Return the positions after each step; see `PathFormat.paths_of`."""
        xy = np.stack([records[name] for name in self.names], -1)  # (T, S, E, 2)
        return EpisodePaths(np.moveaxis(xy, 0, 2))

    def draw(
        self, panels: Sequence[tuple[str, Episodes]], path: Path, title: str, colour: str
    ) -> None:
        """Draw the paths, coloured by time; see `PathFormat.draw`."""
        from repaint_cli.envs.gymnasium.position_figure import plot_positions
        from repaint_cli.report.path_panels import PathPanel, label_of

        drawn = []
        for name, episodes in panels:
            assert episodes.paths is not None
            drawn.append(PathPanel(episodes.paths[0], label_of(name, episodes.returns[0].mean())))
        plot_positions(drawn, self.names, path, title)
