"""Rollout storage: what happened in S × N environments, step by step."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import torch

from repaint_cli.envs.episodes import Steps
from repaint_cli.learn.rollout.observations import (
    Observations,
    ObservationStore,
    arrays_of,
    each,
)
from repaint_cli.policies.distributions import Distribution, concat_samples
from repaint_cli.policies.spaces import by_name


@dataclass(frozen=True)
class Rollout:
    """A rollout, step by step. Invalid entries (resets, ended episodes) are not to be read."""

    observations: Observations
    """The observations, each stored once."""
    index: np.ndarray
    """Where each observation is in its seed's store, (T+1, S, N); row t+1 truly followed row t."""
    actions: np.ndarray
    """What the policy chose, before any clipping to bounds: (T, S, N, A) or (T, S, N) int64."""
    behavior_log_probs: np.ndarray
    """log μ(a|s) of the policy that acted, (T, S, N)."""
    reward_terms: np.ndarray
    """φ, (T, S, N, F)."""
    rewards: np.ndarray
    """w·φ, (T, S, N)."""
    terminations: np.ndarray
    """Whether the step ended the episode for good, (T, S, N)."""
    truncations: np.ndarray
    """Whether a time limit cut the episode there, (T, S, N)."""
    valid: np.ndarray
    """Whether the step counts, (T, S, N)."""
    records: dict[str, np.ndarray] = field(default_factory=dict)
    """Further records from `info`, each (T, S, N, …)."""
    last_obs: Any = None
    """What was observed after the last step, (S · N, *O), or several such arrays by name."""
    returns_before: np.ndarray | float = 0.0
    """What the episodes that run when the rollout begins had earned before it, (S, N)."""
    lengths_before: np.ndarray | int = 0
    """Their steps before it, (S, N)."""
    scaled_rewards: np.ndarray | None = None
    """What advantages and returns are estimated from, (T, S, N), where it is not `rewards`."""

    @property
    def steps(self) -> Steps:
        """What was done, without observations, as simulators log it."""
        ends = self.terminations | self.truncations
        return Steps(self.actions, self.rewards, self.valid, ends, self.records)

    def episodes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return (seed, return, length) of every episode that ended here, (episodes,) each."""
        ended, _, _ = self._follow_episodes()
        seeds, returns, lengths = zip(*ended, strict=True) if ended else ((), (), ())
        return np.array(seeds, int), np.array(returns), np.array(lengths, int)

    def running_episodes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return what the episodes that run at the end have earned, and their steps, (S, N) each.

        Both are 0 where an episode ended with the last step.
        """
        return self._follow_episodes()[1:]

    def _follow_episodes(self) -> tuple[list[tuple[int, float, int]], np.ndarray, np.ndarray]:
        """Return the episodes that ended, and return and length of those that run, (S, N) each."""
        shape = self.valid.shape[1:]
        total, length = np.zeros(shape) + self.returns_before, np.zeros(shape, int)
        length += self.lengths_before
        ended: list[tuple[int, float, int]] = []
        for t, valid in enumerate(self.valid):
            total += np.where(valid, self.rewards[t], 0)
            length += valid
            over = valid & (self.terminations[t] | self.truncations[t])
            ended += [(s, total[s, n], length[s, n]) for s, n in zip(*over.nonzero(), strict=True)]
            total[over], length[over] = 0, 0
        return ended, total, length

    def mean_episodes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return each seed's mean return and length of the episodes that ended here, (S,) each.

        They are nan where none did.
        """
        n_seeds = self.valid.shape[1]
        seeds, returns, lengths = self.episodes()
        ended = np.bincount(seeds, minlength=n_seeds)
        with np.errstate(invalid="ignore"):
            sums = (np.bincount(seeds, numbers, n_seeds) for numbers in (returns, lengths))
            mean_return, mean_length = (total / ended for total in sums)
        return mean_return, mean_length

    def without_observations(self) -> "Rollout":
        """Return the rollout without its observations, to save memory."""
        return replace(self, observations=Observations([]), last_obs=None)


class RolloutBuilder:
    """Lists that grow step by step, and become a Rollout."""

    def __init__(
        self, shape: tuple[int, int], record: Sequence[str], keep_images: bool = True
    ) -> None:
        """Start empty, for (S, N) environments and further numbers from `info`, by name."""
        self.shape, self._keep_images = shape, keep_images
        self.n_steps = 0
        self._stores: list[Any] = []
        self._stored: list[np.ndarray] = []
        self._envs: list[Any] = []
        self._distributions: list[Distribution] = []
        self._steps: list[tuple[np.ndarray, ...]] = []
        self._terms: list[np.ndarray] = []
        self._records: dict[str, list[np.ndarray]] = {name: [] for name in record}

    def add_observations(self, obs: Any, mask: np.ndarray) -> None:
        """Store the observations (S, N, *O) where mask (S, N), images if they are to be kept."""
        if not self._keep_images and any(array.ndim > 3 for array in arrays_of(obs)):
            mask = np.zeros_like(mask)
        self._stored.append(mask)
        if not self._stores:
            self._stores = [each(ObservationStore, obs) for _ in mask]
        for s, row in enumerate(mask):
            for name, array in by_name(obs).items():
                by_name(self._stores[s])[name].append(array[s, row])

    def add_step(
        self, envs: Any, distribution: Distribution, info: dict[str, Any], *step: np.ndarray
    ) -> None:
        """Store a step.

        Args:
            envs: index into (S, N): the environments that the distribution is about.
            distribution: π(·|s) there.
            info: what the environments reported beside it.
            step: valid, actions, rewards, terminations and truncations, (S, N, …) each.
        """
        self.n_steps += 1
        self._envs.append(envs)
        self._distributions.append(distribution)
        self._steps.append(step)
        self._terms.append(info["reward_terms"].reshape(*self.shape, -1))
        for name, rows in self._records.items():
            row = np.array(info[name], float)
            rows.append(row.reshape(*self.shape, *row.shape[1:]))

    def build(self, last_obs: Any) -> Rollout:
        """Stack what was stored; `last_obs` was observed after the last step."""
        valid, actions, rewards, terminated, truncated = map(
            np.stack, zip(*self._steps, strict=True)
        )
        observations = Observations([each(ObservationStore.tensor, own) for own in self._stores])
        return Rollout(
            observations, index_of(self._stored), actions, self._log_probs(actions),
            np.stack(self._terms), rewards, terminated, truncated, valid,
            {name: np.stack(rows) for name, rows in self._records.items()}, last_obs,
        )  # fmt: skip

    def _log_probs(self, actions: np.ndarray) -> np.ndarray:
        """Return log μ(a|s) of actions (T, S, N, …) where the policy was asked, (T, S, N)."""
        chosen = [step[envs] for step, envs in zip(actions, self._envs, strict=True)]
        known = concat_samples(self._distributions).log_prob(
            torch.from_numpy(np.concatenate(chosen, 1))
        )
        log_probs, start = np.zeros(actions.shape[:3], np.float32), 0
        for step, envs, some in zip(log_probs, self._envs, chosen, strict=True):
            step[envs] = known[:, start : start + some.shape[1]]
            start += some.shape[1]
        return log_probs


def index_of(stored: Sequence[np.ndarray]) -> np.ndarray:
    """Return where each observation is in its seed's store, (T+1, S, N).

    A store is filled step by step with those that are `stored`, (T+1,) of (S, N).
    """
    marks = np.stack(stored, 1)  # (S, T+1, N)
    index = marks.reshape(len(marks), -1).cumsum(1).reshape(marks.shape) - 1
    return np.where(marks, index, 0).swapaxes(0, 1)
