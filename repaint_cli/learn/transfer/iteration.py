"""What an iteration of a transfer is to do."""

from dataclasses import dataclass

from torch import Tensor

from repaint_cli.learn.transfer.schedules import Phase


@dataclass(frozen=True)
class Iteration:
    """Iteration k: what it does, and the numbers that differ from one iteration to the next."""

    k: int
    """Its number, from 1."""
    phase: Phase
    """What it does."""
    learning_rate: float
    """Adam's step size."""
    policy_scale: float
    """What the policies' step size is multiplied by: α₂ in an instance iteration, else α₁."""
    instance_scale: float
    """What it is multiplied by for L_ins in a joint iteration: α₂."""
    clip_range: float
    """ε of the clipped surrogate."""
    betas: Tensor
    """β_k of each teacher for each seed, (M, S)."""
    distils: bool = False
    """Whether the students then imitate the teachers alone for a while."""
