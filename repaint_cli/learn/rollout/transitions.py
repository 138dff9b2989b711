"""Transitions (s, a, s′, r) of a rollout, in the order of its samples."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from repaint_cli.envs.reward_terms import weighted_sum
from repaint_cli.learn.rollout.batches import SeedBatch
from repaint_cli.learn.rollout.observations import Observations
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.states import below, with_prefix


@dataclass(frozen=True)
class Transitions(SeedBatch):
    """What followed what; each seed's first counts[s] are real."""

    observations: Observations
    """The observations they refer to."""
    rows: Tensor
    """Which observation is s, (S, B) int64."""
    next_rows: Tensor
    """Which is s′, (S, B) int64."""
    actions: Tensor
    """a, (S, B, A) or (S, B) int64."""
    rewards: Tensor
    """r, (S, B)."""
    terminations: Tensor
    """Whether s′ ended the episode for good, (S, B) bool."""
    counts: Tensor
    """How many are real, (S,) int64."""

    def state(self) -> dict[str, Tensor]:
        """Return all as tensors, each seed's observations by themselves: store/0/camera."""
        tensors = {**self.columns, "counts": self.counts}
        for s, store in enumerate(self.observations.stores):
            arrays = store if isinstance(store, Mapping) else {"": store}
            tensors |= with_prefix(f"store/{s}/", arrays)
        return tensors

    @classmethod
    def of_state(cls, state: Mapping[str, Tensor]) -> Self:
        """Return the transitions that `state` described.

        Raises:
            KeyError: the counts are missing.
            TypeError: a tensor is missing or unknown.
        """
        per_seed = [below(f"store/{s}/", state) for s in range(len(state["counts"]))]
        stores: list[Any] = [arrays.get("", arrays) for arrays in per_seed]
        columns = {n: tensor for n, tensor in state.items() if not n.startswith("store/")}
        return cls(observations=Observations(stores), **columns)


@dataclass(frozen=True)
class Experience(Transitions):
    """Transitions, each with whether a teacher acted."""

    from_teacher: Tensor
    """Whether a teacher acted, (S, B) bool."""


def flat(rollout: Rollout, array: np.ndarray) -> Tensor:
    """Lay each seed's valid steps in a row, padded with zeros: (T, S, N, …) → (S, B, …)."""
    valid = rollout.valid
    rows = [torch.from_numpy(array[:, s][valid[:, s]]) for s in range(valid.shape[1])]
    return torch.nn.utils.rnn.pad_sequence(rows, batch_first=True)


def counts_of(rollout: Rollout) -> Tensor:
    """Return how many valid steps each seed has, (S,) int64."""
    return torch.from_numpy(rollout.valid.sum((0, 2)))


def transitions(rollout: Rollout, weights: np.ndarray | None = None) -> Transitions:
    """Return a rollout's transitions, with rewards w·φ of its own task or of another.

    Args:
        rollout: of the student or of a teacher.
        weights: w of another task with the same terms, (F,); the rollout's own where absent.
    """
    rewards: Any = (
        rollout.rewards if weights is None else weighted_sum(rollout.reward_terms, weights)
    )
    return Transitions(
        observations=rollout.observations,
        rows=flat(rollout, rollout.index[:-1]),
        next_rows=flat(rollout, rollout.index[1:]),
        actions=flat(rollout, rollout.actions),
        rewards=flat(rollout, rewards).float(),
        terminations=flat(rollout, rollout.terminations),
        counts=counts_of(rollout),
    )
