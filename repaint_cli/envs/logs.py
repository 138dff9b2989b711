"""Logs of episodes in a simulator's own format.

**E** episodes · **B** steps of all of them.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from repaint_cli.envs.episodes import Episodes, Steps
from repaint_cli.settings import PPOConfig


@dataclass(frozen=True)
class LoggedRun:
    """The facts of a run that its log holds."""

    ppo: PPOConfig
    """Training."""
    n_convolutions: int
    """How many convolutions the policy's camera network has."""
    reward_function: str | None
    """The text of a user's reward function, if that is the reward."""
    scale: float = 1.0
    """What its pay is multiplied by before it is a reward; logs hold what it pays."""


class EpisodeLog(ABC):
    """A seed's log of its episodes; a resumed run appends to it."""

    @property
    @abstractmethod
    def position(self) -> dict[str, float]:
        """How far the log is, for `go_back`."""

    @abstractmethod
    def go_back(self, k: int, position: Mapping[str, float]) -> None:
        """Remove what was logged after iteration k, when the log was at `position`.

        An empty position is the log's beginning.

        Raises:
            CheckpointError: the log is damaged.
        """

    @abstractmethod
    def log_training(self, k: int, steps: Steps, s: int) -> None:
        """Log what seed s did in the rollout of iteration k, from 1."""

    @abstractmethod
    def log_evaluation(self, k: int, steps: Steps, s: int) -> None:
        """Log the evaluation of seed s after iteration k."""


class ReplayedEpisode(NamedTuple):
    """An episode of a log, with what it was paid and what another reward pays for it."""

    log: str
    """The file that holds it, as tables call it."""
    number: int
    """What the log calls it."""
    steps: int
    """That are paid for."""
    progress: float
    """How far it came, %."""
    ended: str
    """How it ended."""
    whole: bool
    """Whether it came all the way."""
    logged: float
    """Its reward as logged."""
    new: float
    """Its reward now."""


@dataclass(frozen=True)
class Replay:
    """Logged episodes, paid by another reward."""

    episodes: list[ReplayedEpisode]
    """In the order of the logs."""
    logged: np.ndarray
    """What each step that is paid for was paid, (B,)."""
    new: np.ndarray
    """What it is paid now, (B,)."""
    notes: list[str]
    """What is worth knowing besides."""

    @property
    def returns(self) -> tuple[np.ndarray, np.ndarray]:
        """What each episode was paid, and is paid now, each (E,)."""
        logged, new = np.array([(one.logged, one.new) for one in self.episodes]).T
        return logged, new

    @property
    def whole(self) -> np.ndarray:
        """Which episodes came all the way, (E,)."""
        return np.array([one.whole for one in self.episodes])


class LogFormat(ABC):
    """A simulator's format of logs: where they lie in a run, how they are written and drawn."""

    @abstractmethod
    def folders(self, run: Path, seeds: Sequence[int]) -> list[Path]:
        """Return where a run keeps each seed's log, (S,)."""

    @abstractmethod
    def open(self, folder: Path, run: LoggedRun) -> EpisodeLog:
        """Begin a run's own log in its folder, or go on with it.

        Raises:
            StoreError: the folder cannot be written.
        """

    @abstractmethod
    def log_episodes(
        self, folder: Path, run: LoggedRun, episodes: Episodes, s: int, stamp: str
    ) -> list[Path]:
        """Log evaluated episodes of seed s on their own; return the files.

        Args:
            folder: where to.
            run: that the policy is of.
            episodes: what was evaluated.
            s: which of the seeds.
            stamp: the time, 14 digits.

        Raises:
            StoreError: the folder cannot be written, or holds logs of other settings.
        """

    @abstractmethod
    def draw_training(
        self, run: Path, seeds: Sequence[int], progress: np.ndarray | None, title: str
    ) -> list[Path]:
        """Draw what a run's logs show of its first seed's training; return the pictures.

        Args:
            run: its folder.
            seeds: its seeds, (S,).
            progress: evaluated mean progress, (S, K) in %, where recorded.
            title: over the figures.
        """

    @abstractmethod
    def replay(
        self, logs: Sequence[Path], weights: Mapping[str, float], code: tuple[str, str] | None
    ) -> Replay:
        """Pay the episodes of logs by another reward, in the environment's settings.

        Args:
            logs: files, and folders of them.
            weights: of the reward terms φ.
            code: in place of those, a user's reward function: the file's name, and its text.

        Raises:
            NotFound: there are no logs.
            CheckpointError: a log is damaged.
            CardError: a log is of another environment, the reward needs what logs do not hold, or
                the function failed.
        """
