"""From a rollout to samples: generalised advantage estimates with the student's critic."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import torch
from torch import Tensor

from repaint_cli.learn.rollout.batches import SeedBatch
from repaint_cli.learn.rollout.collect import Policy
from repaint_cli.learn.rollout.observations import Observations
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.rollout.transitions import counts_of, flat
from repaint_cli.learn.side_by_side import side_by_side
from repaint_cli.policies.devices import HOST
from repaint_cli.policies.distributions import Distribution, concat_samples
from repaint_cli.settings import PPOConfig

CHUNK = 512
"""Images in one pass of a network; bounds the memory of a pass over a whole rollout."""

Value = Callable[[Any, Sequence[int]], Tensor]
"""Maps observations (S, B, *O), of which the first counts[s] are real, to V, (S, B)."""


@dataclass(frozen=True)
class Samples(SeedBatch):
    """Transitions without order, ready for minibatches; each seed's first counts[s] are real."""

    observations: Observations
    """The observations they refer to."""
    rows: Tensor
    """Which observation each saw, (S, B) int64."""
    actions: Tensor
    """What was done, (S, B, A) or (S, B) int64."""
    behavior_log_probs: Tensor
    """log μ(a|s) of the policy that acted, (S, B)."""
    advantages: Tensor
    """Â(s, a), raw until `standardize`, (S, B)."""
    returns: Tensor
    """Â + V, the critic's targets, (S, B)."""
    rewards: Tensor
    """r of the target task, (S, B)."""
    counts: Tensor
    """How many are real, (S,) int64."""
    behavior: Distribution | None = None
    """μ(·|s), (S, B), where the objective asks for more of it than log μ(a|s)."""

    def __post_init__(self) -> None:
        for name, column in self.columns.items():
            if isinstance(column, Tensor) and column.shape[:2] != self.rows.shape:
                shape, rows_shape = tuple(column.shape[:2]), tuple(self.rows.shape)
                raise ValueError(f"{name} is {shape}, rows are {rows_shape}")


def gae(
    rewards: np.ndarray,
    values: np.ndarray,
    next_values: np.ndarray,
    terminations: np.ndarray,
    ends: np.ndarray,
    gamma: float,
    gae_lambda: float,
) -> np.ndarray:
    """Return generalised advantage estimates (Schulman et al. 2016, eq. 16), backwards in time.

        δₜ = rₜ + γ·(1 − terminatedₜ)·V(sₜ₊₁) − V(sₜ)
        Âₜ = δₜ + γλ·(1 − endₜ)·Âₜ₊₁             end = terminated, truncated, or the last of the
        rollout

    `next_values` holds V of the state that truly followed, also where the environment was reset, so
    neither truncation nor the end of the rollout is a special case. Every array is (T, …).
    """
    deltas: np.ndarray = rewards + gamma * np.where(terminations, 0.0, next_values) - values
    advantages, carry = np.empty_like(deltas), np.zeros_like(deltas[0])
    for t in reversed(range(len(deltas))):
        carry = deltas[t] + gamma * gae_lambda * np.where(ends[t], 0.0, carry)
        advantages[t] = carry
    return advantages


def to_samples(rollout: Rollout, value: Value, ppo: PPOConfig) -> Samples:
    """Estimate advantages with the student's critic and lay the valid steps out as samples.

    REINFORCE's relatedness R̂ − b, with R̂ the return and b = V, is λ = 1 (paper, appendix A).

    Args:
        rollout: of the student or of a teacher; rewards are the target task's.
        value: the student's critic.
        ppo: γ, λ, and what a time limit means.
    """
    gae_lambda = 1.0 if ppo.objective == "reinforce" else ppo.gae_lambda
    terminations = rollout.terminations
    if ppo.time_limit == "terminal":
        terminations = terminations | rollout.truncations
    values = _values(rollout, value)  # (T+1, S, N)
    followed = np.concatenate([rollout.valid[1:], np.zeros_like(rollout.valid[:1])])
    ends = ~followed  # after an episode's last step comes a reset, which is not valid
    rewards = rollout.rewards if rollout.scaled_rewards is None else rollout.scaled_rewards
    advantages = gae(rewards, values[:-1], values[1:], terminations, ends, ppo.gamma, gae_lambda)

    return Samples(
        observations=rollout.observations,
        rows=flat(rollout, rollout.index[:-1]),
        actions=flat(rollout, rollout.actions),
        behavior_log_probs=flat(rollout, rollout.behavior_log_probs),
        advantages=flat(rollout, advantages).float(),
        returns=flat(rollout, advantages + values[:-1]).float(),
        rewards=flat(rollout, rollout.rewards).float(),
        counts=counts_of(rollout),
    )


def _values(rollout: Rollout, value: Value) -> np.ndarray:
    """Return V of every stored observation where it stands in the rollout, (T+1, S, N) float64."""
    sizes = rollout.observations.sizes
    rows = torch.minimum(torch.arange(int(sizes.max())).repeat(len(sizes), 1), sizes[:, None] - 1)
    stored: np.ndarray = torch.cat(_passes(value, rollout.observations, rows, sizes), 1).numpy()
    per_seed = [stored[s][rollout.index[:, s]] for s in range(len(sizes))]
    values: np.ndarray = np.stack(per_seed, 1).astype(np.float64)
    return values


def describe(policy: Policy, samples: Samples) -> Distribution:
    """Return a policy's distributions at all samples, (S, B), without gradients."""
    return concat_samples(_passes(policy, samples.observations, samples.rows, samples.counts))


def _passes(
    network: Callable[[Any, Sequence[int]], Any],
    observations: Observations,
    rows: Tensor,
    counts: Tensor,
) -> list[Any]:
    """Return a network's outputs at observations (S, B), in chunks, without gradients.

    They are brought to the host.
    """

    def outputs(start: int, size: int) -> Any:
        chunk = rows[:, start : start + size]
        real = (counts - start).clamp(0, chunk.shape[1]).tolist()
        with torch.no_grad():
            return network(observations.take(chunk), real).to(HOST)

    if observations.small:
        return [outputs(0, rows.shape[1])]
    return side_by_side([partial(outputs, i, CHUNK) for i in range(0, rows.shape[1], CHUNK)])
