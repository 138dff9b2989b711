"""Steps in environments, and evaluated episodes: arrays only.

**S** seeds · **T** steps · **N** environments or **E** episodes per seed · **A** action · **F**
reward terms · **O** observation.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np


@dataclass(frozen=True)
class Steps:
    """Steps of S × N environments. Entries that are not valid are not to be read."""

    actions: np.ndarray
    """What the environments were given, (T, S, N[, A])."""
    rewards: np.ndarray
    """What each step earned, (T, S, N)."""
    valid: np.ndarray
    """Whether the step counts, (T, S, N)."""
    ends: np.ndarray
    """Whether the step ended an episode, (T, S, N)."""
    records: dict[str, np.ndarray]
    """What the simulator records of each step, (T, S, N, …) by name."""

    def episodes(self, s: int) -> Iterator[tuple[np.ndarray, int, int]]:
        """Yield the index of each episode of a seed, environment by environment.

        The index, (steps, s, n), cuts the episode out of an array (T, S, N, …); the last one of an
        environment may be unfinished.
        """
        for n in range(self.valid.shape[2]):
            steps = np.flatnonzero(self.valid[:, s, n])
            for episode in np.split(steps, np.flatnonzero(self.ends[steps, s, n]) + 1):
                if len(episode):
                    yield episode, s, n


class BegunEpisode(NamedTuple):
    """An episode up to some step, from which it can be played again."""

    first_seed: int
    """The seed of the environment's first episode."""
    episode: int
    """Which episode it is, from 0."""
    actions: Any
    """The actions since it began, as the environment was given them, (L, …)."""


class EpisodePaths(NamedTuple):
    """Where the car or the fingertip of each episode went, and where it should have gone."""

    positions: np.ndarray
    """(S, E, T, 2) in m, nan after an episode's end."""
    targets: np.ndarray | None = None
    """(S, E, 2) in m, where there are any."""


@dataclass(frozen=True)
class Episodes:
    """E evaluated episodes of each of S policies."""

    returns: np.ndarray
    """Undiscounted sum of the rewards, (S, E)."""
    lengths: np.ndarray
    """Steps, (S, E)."""
    terms: np.ndarray
    """Undiscounted sums of the reward terms φ, (S, E, F)."""
    rewards: np.ndarray
    """Reward per step, (T, S, E), nan after the end."""
    actions: np.ndarray
    """What the environment was given, (T, S, E[, A]); continuous actions within their bounds."""
    records: dict[str, np.ndarray]
    """What the simulator records of each step, (T, S, E, …) by name, nan after the end."""
    env_seeds: list[int]
    """The environments' seeds, (S · E,), seed by seed."""
    paths: np.ndarray | None
    """Positions along each episode, (S, E, T, 2) in m, nan after the end."""
    targets: np.ndarray | None
    """Where each episode should have led, (S, E, 2) in m."""
    observations: list[list[Any]] | None = None
    """The observation after each step, [S][E] of (T, *O), where it was asked for."""

    @property
    def progress(self) -> np.ndarray | None:
        """How much of the way was done when the episode ended, (S, E) in %, where recorded."""
        return self.last("progress")

    @property
    def status(self) -> np.ndarray | None:
        """How each episode ended, (S, E) numbers that the simulator gives, where recorded."""
        return self.last("status")

    @property
    def lap_times(self) -> np.ndarray | None:
        """How long each whole lap took, (S, E) in s, nan where there was none, where recorded."""
        seconds, progress = self.last("lap_time"), self.progress
        if seconds is None or progress is None:
            return None
        return np.where(progress >= 100, seconds, np.nan)

    @property
    def steps(self) -> Steps:
        """The same episodes step by step."""
        times = np.arange(len(self.rewards))[:, None, None]
        return Steps(
            self.actions, self.rewards, times < self.lengths, times == self.lengths - 1,
            self.records,
        )  # fmt: skip

    def of_seed(self, s: int) -> "Episodes":
        """Return the episodes of one of the policies, without its observations."""
        only, per = slice(s, s + 1), len(self.env_seeds) // len(self.returns)
        return Episodes(
            returns=self.returns[only],
            lengths=self.lengths[only],
            terms=self.terms[only],
            rewards=self.rewards[:, only],
            actions=self.actions[:, only],
            records={name: rows[:, only] for name, rows in self.records.items()},
            env_seeds=self.env_seeds[s * per : (s + 1) * per],
            paths=None if self.paths is None else self.paths[only],
            targets=None if self.targets is None else self.targets[only],
        )

    def last(self, name: str) -> np.ndarray | None:
        """Return what was recorded at each episode's last step, (S, E), or None."""
        if name not in self.records:
            return None
        ends = self.lengths[None] - 1
        last: np.ndarray = np.take_along_axis(self.records[name], ends, axis=0)[0]
        return last


class Parts(NamedTuple):
    """Episodes by what they were played on, where it differs."""

    name: str
    """Of what differs, such as "track"."""
    episodes: dict[str, np.ndarray]
    """Which episodes are of each part, (E,) bool, by its name."""


class Column(NamedTuple):
    """A column of the table of evaluated episodes."""

    name: str
    """Its head, with the unit."""
    values: np.ndarray
    """A number per episode, (E,), nan where an episode has none."""
    shown: Literal["interval", "mean", "count"] = "interval"
    """As the mean with its 95 % interval, the mean alone, or how many episodes have a number."""
