"""What is remembered of S × N environments: who acted, what was paid, how it ended."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch

from repaint_cli.envs.episodes import Steps
from repaint_cli.learn.rollout.observations import Frames, Store, each, parts
from repaint_cli.policies.distributions import Distribution, concat_samples


@dataclass(frozen=True)
class Rollout:
    """What happened, step by step. Invalid entries (resets, ended episodes) are not to be read."""

    frames: Frames
    """The observations."""
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
    """Whatever else was asked for from `info`, each (T, S, N, …)."""

    @property
    def steps(self) -> Steps:
        """What was done, without observations, as simulators log it."""
        ends = self.terminations | self.truncations
        return Steps(self.actions, self.rewards, self.valid, ends, self.records)

    def episodes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return (seed, return, length) of every episode that ended here, (episodes,) each."""
        total, length = np.zeros(self.valid.shape[1:]), np.zeros(self.valid.shape[1:], int)
        ended: list[tuple[int, float, int]] = []
        for t, valid in enumerate(self.valid):
            total += np.where(valid, self.rewards[t], 0)
            length += valid
            over = valid & (self.terminations[t] | self.truncations[t])
            ended += [(s, total[s, n], length[s, n]) for s, n in zip(*over.nonzero(), strict=True)]
            total[over], length[over] = 0, 0
        seeds, returns, lengths = zip(*ended, strict=True) if ended else ((), (), ())
        return np.array(seeds, int), np.array(returns), np.array(lengths, int)

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


class Tape:
    """Lists that grow step by step, and become a Rollout."""

    def __init__(self, shape: tuple[int, int], record: Sequence[str]) -> None:
        self.shape = shape
        self.seen: list[Any] = []
        self.kept: list[np.ndarray] = []
        self.seats: list[Any] = []
        self.distributions: list[Distribution] = []
        self.steps: list[tuple[np.ndarray, ...]] = []
        self.terms: list[np.ndarray] = []
        self.records: dict[str, list[np.ndarray]] = {name: [] for name in record}

    def observe(self, obs: Any, keep: np.ndarray) -> None:
        """Store the observations (S, N, *O) where keep (S, N)."""
        self.kept.append(keep)
        if not self.seen:
            self.seen = [each(Store, obs) for _ in keep]
        for s, mask in enumerate(keep):
            for store, part in zip(parts(self.seen[s]), parts(obs), strict=True):
                store.append(part[s, mask])

    def act(
        self, seats: Any, distribution: Distribution, info: dict[str, Any], *step: np.ndarray
    ) -> None:
        """Store a step: who might have done what, what was done, what came of it."""
        self.seats.append(seats)
        self.distributions.append(distribution)
        self.steps.append(step)
        self.terms.append(info["reward_terms"].reshape(*self.shape, -1))
        for name, rows in self.records.items():
            told = np.array(info[name], float)
            rows.append(told.reshape(*self.shape, *told.shape[1:]))

    def rollout(self) -> Rollout:
        """Stack what was stored."""
        valid, actions, rewards, terminated, truncated = map(
            np.stack, zip(*self.steps, strict=True)
        )
        frames = Frames([each(Store.tensor, seen) for seen in self.seen])
        return Rollout(
            frames, self._index(), actions, self._log_probs(actions), np.stack(self.terms), rewards,
            terminated, truncated, valid,
            {name: np.stack(rows) for name, rows in self.records.items()},
        )  # fmt: skip

    def _index(self) -> np.ndarray:
        """Return where each observation went in its seed's store, (T+1, S, N)."""
        keep = np.stack(self.kept, 1)  # (S, T+1, N): a store is filled step by step
        places = keep.reshape(len(keep), -1).cumsum(1).reshape(keep.shape) - 1
        return np.where(keep, places, 0).swapaxes(0, 1)

    def _log_probs(self, actions: np.ndarray) -> np.ndarray:
        """Return log μ(a|s) of actions (T, S, N, …) where somebody looked, (T, S, N), in one go."""
        chosen = [step[seats] for step, seats in zip(actions, self.seats, strict=True)]
        known = concat_samples(self.distributions).log_prob(
            torch.from_numpy(np.concatenate(chosen, 1))
        )
        log_probs, start = np.zeros(actions.shape[:3], np.float32), 0
        for step, seats, some in zip(log_probs, self.seats, chosen, strict=True):
            step[seats] = known[:, start : start + some.shape[1]]
            start += some.shape[1]
        return log_probs
