"""Transitions (s, a, s′, r) of a rollout, in the order of its samples."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from repaint_cli.learn.rollout.batches import Batch
from repaint_cli.learn.rollout.observations import Frames
from repaint_cli.learn.rollout.storage import Rollout


@dataclass(frozen=True)
class Transitions(Batch):
    """What followed what; each seed's first counts[s] are real."""

    frames: Frames
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


@dataclass(frozen=True)
class Experience(Transitions):
    """Transitions that remember who made them."""

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
        rollout: whoever acted.
        weights: w of another task with the same terms, (F,); the rollout's own where absent.
    """
    rewards: Any = rollout.rewards if weights is None else rollout.reward_terms @ weights
    return Transitions(
        frames=rollout.frames,
        rows=flat(rollout, rollout.index[:-1]),
        next_rows=flat(rollout, rollout.index[1:]),
        actions=flat(rollout, rollout.actions),
        rewards=flat(rollout, rewards).float(),
        terminations=flat(rollout, rollout.terminations),
        counts=counts_of(rollout),
    )
