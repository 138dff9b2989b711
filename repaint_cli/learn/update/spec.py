"""What one update is to do: the same record for the plain and for the compiled one."""

from dataclasses import dataclass, replace
from math import inf
from typing import Literal

import numpy as np
import torch
from torch import Tensor

from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.policies.distributions import Distribution
from repaint_cli.settings import PPOConfig

Networks = Literal["both", "policy", "critic"]
"""Which networks an update moves."""


@dataclass(frozen=True)
class UpdateSpec:
    """Which loss an update follows, which networks it moves, and with which numbers."""

    ppo: PPOConfig
    """Epochs, minibatches and coefficients."""
    clip_range: float
    """ε of this iteration."""
    loss: Literal["representation", "instance", "distillation"] = "representation"
    """L_rep with the critic's loss, on the student's samples; L_ins, on the teachers'; or the
    cross-entropy to the teacher alone, on any samples."""
    networks: Networks = "both"
    """Which networks move; L_ins moves policies only."""
    teacher: Distribution | None = None
    """π_teacher(·|s) at the samples, (S, B), for the cross-entropy; None leaves it out."""
    beta: Tensor | float = 0.0
    """β_k, weight of the cross-entropy, of all seeds or (S,)."""
    policy_scale: float = 1.0
    """What the policies' learning rate is multiplied by."""
    instances: Samples | None = None
    """Selected teacher samples of a joint update: every minibatch takes its share of them (paper,
    algorithm 1)."""
    instance_scale: float = 1.0
    """α₂: what the learning rate of their steps is multiplied by."""
    importance: bool = True
    """Whether teacher samples are weighed by ρ where the objective does not contain it."""

    def __post_init__(self) -> None:
        if self.loss != "representation" and self.networks != "policy":
            raise ValueError(f"{self.loss} trains policies only, found {self.networks!r}")

    def to(self, device: torch.device) -> "UpdateSpec":
        """Return the specification with its tensors on a device, but for counts."""
        return replace(
            self,
            teacher=self.teacher and self.teacher.to(device),
            beta=self.beta.to(device) if isinstance(self.beta, Tensor) else self.beta,
            instances=self.instances and self.instances.to(device),
        )

    def alone(self, seed: int, n: int) -> "UpdateSpec":
        """Return the specification for one seed, which has n samples."""
        beta = self.beta[seed : seed + 1] if isinstance(self.beta, Tensor) else self.beta
        return replace(
            self,
            teacher=self.teacher and self.teacher.alone(seed, n),
            beta=beta,
            instances=self.instances and self.instances.alone(seed),
        )

    @property
    def target_kl(self) -> float:
        """The mean approximate KL of an epoch after which a policy stops; infinite for none.

        That of teachers' samples is a distance to the teachers, and stops nothing.
        """
        limit = self.ppo.target_kl if self.loss == "representation" else None
        return inf if limit is None else limit

    @property
    def moves_policy(self) -> bool:
        """Whether policies move."""
        return self.networks != "critic"

    @property
    def moves_critic(self) -> bool:
        """Whether critics move."""
        return self.networks != "policy"

    def of_moved(self, metrics: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the metrics of the networks that moved: the value loss is the critic's."""
        return {
            name: values
            for name, values in metrics.items()
            if (self.moves_critic if name == "value_loss" else self.moves_policy)
        }
