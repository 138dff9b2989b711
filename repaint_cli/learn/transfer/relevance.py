"""Relevance-based transfer, the rival of section 6.2 (Lazaric, Restelli and Bonarini 2008).

A teacher's sample is relevant if target samples near it moved and were paid alike, or if none is
near. A teacher complies with the target as much as the target's samples agree with its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from repaint_cli.learn.rollout.transitions import Transitions
from repaint_cli.settings import SelectConfig


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
    """Return the chance of each source sample to be drawn, (S, B) of all sources in order.

    A source's samples together have its compliance, each its relevance among them.

    Args:
        target: the student's last batch, paid by the target task.
        sources: each teacher's samples, paid by its own task.
        select: the kernels' width and what else is open.
    """
    rows = []
    for s in range(len(target.counts)):
        here = _raw(target, s)
        units = [part.std(0, correction=0).clamp(min=1e-6) for part in here]
        points = _scaled(here, units)
        found = [_judge(points, _scaled(_raw(source, s), units), select) for source in sources]
        compliances = torch.stack([compliance for compliance, _ in found])
        total = compliances.sum()  # 0 where no source has a sample near any of the target's
        even = torch.full_like(compliances, 1 / len(compliances))
        shares = compliances / total if total > 0 else even
        rows.append(
            torch.cat(
                [share * rel / rel.sum() for share, (_, rel) in zip(shares, found, strict=True)]
            )
        )
    return torch.nn.utils.rnn.pad_sequence(rows, batch_first=True)


def _raw(batch: Transitions, s: int) -> tuple[Tensor, Tensor, Tensor]:
    n = int(batch.counts[s])
    store = batch.observations.stores[s].double()
    here, there = store[batch.rows[s, :n]], store[batch.next_rows[s, :n]]
    actions = batch.actions[s, :n].double().reshape(n, -1)
    return torch.cat([here, actions], 1), there - here, batch.rewards[s, :n, None].double()


def _scaled(parts: tuple[Tensor, Tensor, Tensor], units: Sequence[Tensor]) -> _Points:
    return _Points(*(part / unit for part, unit in zip(parts, units, strict=True)))


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
    alike = _kernel(torch.cdist(target.moves, source.moves), select)
    paid = _kernel(torch.cdist(target.rewards, source.rewards), select)
    of_target, of_source = _normalized(near, 1), _normalized(near, 0)
    compliance = ((of_target * alike).mean(1) * (of_target * paid).mean(1)).mean()
    agreement = (of_source * alike).mean(0) * (of_source * paid).mean(0)  # (m,)
    whole = agreement.sum() if select.normalize == "sum" else agreement.max()
    gap = agreement / whole.clamp(min=1e-300) - 1
    reach = _reach(distances.T, of_source.T, select)
    # What is far from everything has nothing against it, and what is too near cannot be told.
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
