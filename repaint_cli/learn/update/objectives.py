"""The losses of a minibatch, a number per seed: L_rep and L_ins (paper, section 4)."""

from collections.abc import Callable
from functools import reduce
from operator import add
from typing import Any

import torch
from torch import Tensor

from repaint_cli.learn.rollout.batches import row_sums
from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.learn.update.losses import (
    approx_kl,
    clipped_surrogate,
    log_likelihood,
    squared_error,
    surrogate,
)
from repaint_cli.learn.update.spec import UpdateSpec
from repaint_cli.policies.distributions import Distribution
from repaint_cli.policies.networks import ActorCritic


def mean_over(counts: Tensor, rows: Tensor) -> Callable[[Tensor], Tensor]:
    """Return the function that takes each seed's mean of its first counts[s] numbers.

    It maps (S, b) to (S,), on the device of the rows (S, b); the mean of none is 0.
    """
    weights = (real_of(counts, rows) / counts.clamp(min=1).unsqueeze(1)).to(rows.device)
    return lambda numbers: (numbers * weights).sum(-1)


def real_of(counts: Tensor, rows: Tensor) -> Tensor:
    """Return which of rows (S, b) are real, bool, where the counts lie."""
    return torch.arange(rows.shape[1], device=counts.device) < counts.unsqueeze(1)


def masked_mean(numbers: Tensor, counts: Tensor) -> Tensor:
    """Return each seed's mean of its first counts[s] numbers, (S, b) → (S,); 0 of none."""
    return row_sums(numbers * (1 / counts.clamp(min=1)).unsqueeze(1), counts)


def objective(log_probs: Tensor, batch: Samples, spec: UpdateSpec, *, of_teacher: bool) -> Tensor:
    """Return −L of each sample, (S, b), by `ppo.objective`; μ is the policy that acted.

    Args:
        log_probs: log π_θ(a|s), (S, b).
        batch: the samples.
        spec: which objective.
        of_teacher: whether a teacher acted.
    """
    mu, advantages = batch.behavior_log_probs, batch.advantages
    if spec.ppo.objective == "clipped":
        return clipped_surrogate(log_probs, mu, advantages, spec.clip_range)
    if spec.ppo.objective == "trpo" or (of_teacher and spec.importance):
        return surrogate(log_probs, mu, advantages)
    return log_likelihood(log_probs, advantages)


def kl_loss(policy: Distribution, batch: Samples, spec: UpdateSpec) -> Tensor | float:
    """Return β·KL(μ‖π_θ), the largest over the states or their mean, (S,); 0 where μ is not kept.

    The paper's TRPO has the "maximum KL divergence computed over states" (appendix A); here these
    are the states of a minibatch.
    """
    if batch.behavior is None or not batch.rows.shape[1]:  # a joint step may have no instances
        return 0.0
    kl = batch.behavior.kl(policy)  # (S, b)
    if spec.ppo.kl_over == "mean":
        return spec.ppo.kl_weight * mean_over(batch.counts, kl)(kl)
    real = real_of(batch.counts, kl).to(kl.device)
    return spec.ppo.kl_weight * kl.where(real, 0.0).amax(1)  # a KL is never negative


def representation_loss(
    student: ActorCritic,
    batch: Samples,
    teacher: Distribution | None,
    spec: UpdateSpec,
) -> tuple[Tensor, dict[str, Tensor]]:
    """Return −L_rep with the critic's loss and PPO's entropy bonus, (S,), and metrics, (S,) each.

        L_rep(θ) = L_clip(θ) − β_k·H(π_teacher‖π_θ)      (paper, equation 2)

    L_clip gives way to `ppo.objective` (paper, appendix A). Without a teacher it is clipped PPO.

    Args:
        student: π_θ and its critic.
        batch: the student's samples, (S, b).
        teacher: π_teacher(·|s) at those samples.
        spec: coefficients, with β_k.
    """
    obs, counts = batch.observations.take(batch.rows), batch.counts
    mean, metrics, loss = mean_over(counts, batch.rows), dict[str, Tensor](), []
    policy, values = _of_moving(student, obs, counts, spec)
    if policy is not None:
        log_probs = policy.log_prob(batch.actions)
        loss_of_samples = mean(objective(log_probs, batch, spec, of_teacher=False))
        metrics |= {
            "policy_loss": loss_of_samples + kl_loss(policy, batch, spec),
            "entropy": mean(policy.entropy().expand_as(log_probs)),
        } | _ratio_metrics(log_probs, batch, spec.clip_range, mean)
        loss += [metrics["policy_loss"], -spec.ppo.ent_coef * metrics["entropy"]]
        if teacher is not None:
            metrics["cross_entropy"] = mean(teacher.cross_entropy(policy))
            loss.append(torch.as_tensor(spec.beta, dtype=torch.float32) * metrics["cross_entropy"])
    if values is not None:
        metrics["value_loss"] = mean(squared_error(values, batch.returns))
        loss.append(spec.ppo.vf_coef * metrics["value_loss"])
    return reduce(add, loss), metrics


def _of_moving(
    student: ActorCritic, obs: Any, counts: Tensor, spec: UpdateSpec
) -> tuple[Distribution | None, Tensor | None]:
    """Return π_θ(·|s) and V(s), (S, b), of the networks that move."""
    if spec.moves_policy and spec.moves_critic:
        return student.policy_and_value(obs, counts)
    if spec.moves_policy:
        return student.policy(obs, counts), None
    return None, student.value(obs, counts)


def instance_loss(
    student: ActorCritic, batch: Samples, spec: UpdateSpec
) -> tuple[Tensor, dict[str, Tensor]]:
    """Return −L_ins, (S,), the objective on teacher samples (paper, equation 3), and metrics.

    No cross-entropy, no entropy bonus, and no critic: its values are regressed on the student's own
    data only.
    """
    policy = student.policy(batch.observations.take(batch.rows), batch.counts)
    log_probs, mean = policy.log_prob(batch.actions), mean_over(batch.counts, batch.rows)
    loss = mean(objective(log_probs, batch, spec, of_teacher=True)) + kl_loss(policy, batch, spec)
    metrics = {"policy_loss": loss} | _ratio_metrics(log_probs, batch, spec.clip_range, mean)
    log_ratio = mean(log_probs - batch.behavior_log_probs)
    return loss, metrics | {"log_ratio": log_ratio, "kept_clip_fraction": metrics["clip_fraction"]}


def distillation_loss(
    student: ActorCritic, batch: Samples, teacher: Distribution
) -> tuple[Tensor, dict[str, Tensor]]:
    """Return H(π_teacher‖π_θ), (S,), alone, and metrics: the policy moves, the critic does not."""
    policy = student.policy(batch.observations.take(batch.rows), batch.counts)
    loss = mean_over(batch.counts, batch.rows)(teacher.cross_entropy(policy))
    return loss, {"cross_entropy": loss}


def _ratio_metrics(
    log_probs: Tensor, batch: Samples, clip_range: float, mean: Callable[[Tensor], Tensor]
) -> dict[str, Tensor]:
    with torch.no_grad():
        log_ratio = log_probs - batch.behavior_log_probs
        return {
            "approx_kl": mean(approx_kl(log_probs, batch.behavior_log_probs)),
            "clip_fraction": mean((torch.expm1(log_ratio).abs() > clip_range).float()),
        }
