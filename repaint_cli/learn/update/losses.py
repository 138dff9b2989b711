"""Formulae only: tensors in, a number per sample out; the caller takes each seed's mean."""

import torch
from torch import Tensor


def clipped_surrogate(
    log_probs: Tensor, behavior_log_probs: Tensor, advantages: Tensor, clip_range: float
) -> Tensor:
    """PPO's clipped objective, negated.

        L(θ) = −min(ρA, clip(ρ, 1−ε, 1+ε)·A),   ρ = π_θ(a|s) / μ(a|s)

    μ is the policy that acted. With μ = π_old this is L_clip (paper, equation 1); with
    μ = π_teacher and only samples of high advantage it is L_ins, the instance-transfer loss of
    REPAINT (paper, equation 3).

    Args:
        log_probs: log π_θ(a|s) under the policy being trained, (S, B).
        behavior_log_probs: log μ(a|s), recorded when the action was taken, (S, B).
        advantages: Â(s, a) estimated with the student's critic, (S, B).
        clip_range: ε in (0, 1).
    """
    ratio = torch.exp(log_probs - behavior_log_probs)
    clipped = ratio.clamp(1 - clip_range, 1 + clip_range)
    return -torch.min(ratio * advantages, clipped * advantages)


def log_likelihood(log_probs: Tensor, advantages: Tensor) -> Tensor:
    """The objective of A2C, and of REINFORCE with R̂ − b in place of Â, negated (paper, appendix A).

        L(θ) = −log π_θ(a|s)·Â

    Args:
        log_probs: log π_θ(a|s), (S, B).
        advantages: Â(s, a), or the return less a baseline, (S, B).
    """
    return -log_probs * advantages


def surrogate(log_probs: Tensor, behavior_log_probs: Tensor, advantages: Tensor) -> Tensor:
    """The objective without clipping, negated.

        L(θ) = −ρA,   ρ = π_θ(a|s) / μ(a|s)

    On the student's samples it is TRPO's, beside a KL (paper, appendix A). On a teacher's it is
    A2C's and REINFORCE's: its gradient −ρA·∇log π_θ is that of J_ins (paper, appendix E).

    Args:
        log_probs: log π_θ(a|s), (S, B).
        behavior_log_probs: log μ(a|s) of the policy that acted, (S, B).
        advantages: Â(s, a), (S, B).
    """
    return -torch.exp(log_probs - behavior_log_probs) * advantages


def squared_error(values: Tensor, returns: Tensor) -> Tensor:
    """The critic's loss (V(s) − R̂)², without clipping; both (S, B)."""
    return (values - returns) ** 2


def approx_kl(log_probs: Tensor, behavior_log_probs: Tensor) -> Tensor:
    """An unbiased, never negative estimate of KL(μ‖π_θ): ρ − 1 − log ρ (Schulman 2020, k3)."""
    log_ratio = log_probs - behavior_log_probs
    return torch.expm1(log_ratio) - log_ratio
