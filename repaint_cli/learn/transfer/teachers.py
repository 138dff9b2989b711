"""Teachers: what each is, which of them act, and their distributions at the student's samples."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from torch import Tensor

from repaint_cli.learn.rollout.collect import Policy
from repaint_cli.learn.rollout.gae import Samples, describe
from repaint_cli.policies.distributions import Distribution, mixture
from repaint_cli.policies.mirror import PolicyNetwork
from repaint_cli.tasks.transfer_settings import TransferConfig


@dataclass(frozen=True)
class Teacher:
    """A policy to learn from."""

    network: PolicyNetwork
    """Its policy as it is looked at, standing S times."""
    acts: bool = True
    """Whether its own samples are learned from in instance iterations."""
    weights: np.ndarray | None = None
    """w of its own task in the order of the target's terms, (F,); None where that is not known."""


class ActingTeacher(NamedTuple):
    """A teacher who acts in an instance iteration."""

    teacher: Teacher
    which: int
    """Its number among those who may act, which names its share and its noise."""
    of: int
    """How many may act."""
    leads: np.ndarray
    """Which seeds learn from its samples, (S,) bool."""


def soften(teacher: PolicyNetwork, transfer: TransferConfig) -> Policy:
    """Return a teacher with a spread, the same for sampling, log-probs and the cross-entropy.

    A trained teacher is nearly deterministic: its samples would have likelihood ratios near 0 under
    any student, and a clipped surrogate with A > 0 has no gradient there.
    """
    return lambda obs, counts: teacher.policy(obs, counts).soften(
        transfer.teacher_min_std, transfer.teacher_temperature
    )


def advise(
    teachers: Sequence[Teacher], betas: Tensor, samples: Samples, transfer: TransferConfig
) -> Distribution | None:
    """Return π_teacher at the samples: all teachers' as one distribution; None with β = 0.

    Args:
        teachers: M of them; those with β = 0 are left out.
        betas: β_k of each, (M, S).
        samples: of the student, (S, B).
        transfer: the teachers' spread.
    """
    used = betas.any(1)
    if not used.any():
        return None
    distributions = [
        describe(soften(teacher.network, transfer), samples)
        for teacher, is_used in zip(teachers, used.tolist(), strict=True) if is_used
    ]  # fmt: skip
    return mixture(distributions, betas[used])
