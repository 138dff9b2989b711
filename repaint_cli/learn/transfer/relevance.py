"""Relevance-based transfer, the baseline of section 6.2 (Lazaric, Restelli and Bonarini 2008).

A teacher's sample is relevant if target samples near it have similar moves and rewards, or if none
is near. A teacher complies with the target as much as the target's samples agree with its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from repaint_cli.learn.rollout.transitions import Transitions
from repaint_cli.tasks.transfer_settings import SelectConfig


@dataclass(frozen=True)
class _Points:
    """One seed's transitions in units of the target's standard deviations."""

    places: Tensor
    """(s, a), (n, O + A)."""
    moves: Tensor
    """s′ − s, (n, O)."""
    rewards: Tensor
    """r, (n, 1)."""


def relevance(target: Transitions, sources: Sequence[Transitions], select: SelectConfig) -> Tensor:
    """Return the probability of drawing each sample of all sources in order, (S, B).

    A source is drawn by its compliance, and its samples by their relevance among them.

    Args:
        target: the student's last batch, with the target task's rewards.
        sources: each teacher's samples, with its own task's rewards.
        select: the kernels' width, the neighbourhood and the normalisation.
    """
    rows = []
    for s in range(len(target.counts)):
        raw = _raw(target, s)
        units = [columns.std(0, correction=0).clamp(min=1e-6) for columns in raw]
        points = _scaled(raw, units)
        per_source = [_judge(points, _scaled(_raw(source, s), units), select) for source in sources]
        compliances = torch.stack([compliance for compliance, _ in per_source])
        total = compliances.sum()  # 0 where no source has a sample near any of the target's
        even = torch.full_like(compliances, 1 / len(compliances))
        shares = compliances / total if total > 0 else even
        rows.append(
            torch.cat(
                [share * of / of.sum() for share, (_, of) in zip(shares, per_source, strict=True)]
            )
        )
    return torch.nn.utils.rnn.pad_sequence(rows, batch_first=True)


def _raw(batch: Transitions, s: int) -> tuple[Tensor, Tensor, Tensor]:
    n = int(batch.counts[s])
    store = batch.observations.stores[s].double()
    here, there = store[batch.rows[s, :n]], store[batch.next_rows[s, :n]]
    actions = batch.actions[s, :n].double().reshape(n, -1)
    return torch.cat([here, actions], 1), there - here, batch.rewards[s, :n, None].double()


def _scaled(raw: tuple[Tensor, Tensor, Tensor], units: Sequence[Tensor]) -> _Points:
    return _Points(*(columns / unit for columns, unit in zip(raw, units, strict=True)))


def _judge(target: _Points, source: _Points, select: SelectConfig) -> tuple[Tensor, Tensor]:
    """Return a source's compliance, and the relevance of its samples, (m,).

        w_ij = φ(‖(s, a)_i − (σ, α)_j‖) / Σ_l φ(‖(s, a)_i − (σ, α)_l‖),   φ(x) = exp(−x²/δ)
        λ_i = (1/m Σ_j w_ij φ(‖Δs_i − Δσ_j‖)) · (1/m Σ_j w_ij φ(|r_i − ρ_j|))    Λ = 1/n Σ_i λ_i
        λ_j likewise, with the roles exchanged;   λ̃_j = λ_j / Σ_l λ_l
        relevance_j = exp(−((λ̃_j − 1) / d_j)²)

    d_j is the mean distance from j to the target's samples within a cumulative weight of μ.
    """
    distances = torch.cdist(target.places, source.places)  # (n, m)
    near = _kernel(distances, select)
    same_moves = _kernel(torch.cdist(target.moves, source.moves), select)
    same_rewards = _kernel(torch.cdist(target.rewards, source.rewards), select)
    of_target, of_source = _normalized(near, 1), _normalized(near, 0)
    compliance = ((of_target * same_moves).mean(1) * (of_target * same_rewards).mean(1)).mean()
    agreement = (of_source * same_moves).mean(0) * (of_source * same_rewards).mean(0)  # (m,)
    whole = agreement.sum() if select.normalize == "sum" else agreement.max()
    gap = agreement / whole.clamp(min=1e-300) - 1
    reach = _reach(distances.T, of_source.T, select)
    # A sample far from all of the target's has a large d_j, and is relevant; no probability is 0.
    return compliance, torch.exp(-((gap / reach) ** 2)).clamp(min=1e-300)


def _kernel(distances: Tensor, select: SelectConfig) -> Tensor:
    return torch.exp(-(distances**2) / select.bandwidth)


def _normalized(weights: Tensor, axis: int) -> Tensor:
    """Return weights that sum to 1 along an axis, or 0 where all are 0."""
    return weights / weights.sum(axis, keepdim=True).clamp(min=1e-300)


def _reach(distances: Tensor, weights: Tensor, select: SelectConfig) -> Tensor:
    """Return d_j, (m,), from distances and weights (m, n); at least one sample is counted."""
    order = distances.argsort(1, descending=select.neighbours == "farthest")
    distances, weights = distances.gather(1, order), weights.gather(1, order)
    within = weights.cumsum(1) - weights < select.neighbourhood
    within[:, 0] = True
    mean = (distances * within).sum(1) / within.sum(1)
    return mean.clamp(min=1e-6)
