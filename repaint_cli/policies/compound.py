"""A distribution over actions of several numbers, of which some count only with some commands.

The first number is a command; the others, such as a point's x and y, are independent of it and of
each other. Of an action's numbers only those count that its command uses:

    log π(a|s) = log π₀(c|s) + Σ_p u_cp·log π_p(a_p|s)

Shapes: S seeds, B samples, C commands, P numbers, A sum of their sizes.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from repaint_cli.policies.devices import OnDevice

if TYPE_CHECKING:
    from repaint_cli.policies.distributions import Distribution

HIDDEN = -1e4
"""Log-probability of a command that is masked: small enough to be 0, and finite."""


@dataclass(frozen=True)
class Compound(OnDevice):
    """A distribution over commands, and over each further number of an action."""

    log_probs: Tensor
    """log π₀(·|s), log π₁(·|s), …, one behind the other, each normalised, (S, B, A)."""
    sizes: tuple[int, ...]
    """How many values each number has, (P,)."""
    uses: Tensor
    """u, which further numbers count with each command: 1 or 0, (C, P − 1)."""

    @classmethod
    def from_logits(
        cls, logits: Tensor, sizes: tuple[int, ...], uses: Tensor, available: Tensor | None = None
    ) -> "Compound":
        """Normalise logits (S, B, A); commands that are not available, (S, B, C), are left out.

        Where none is available all are as likely.
        """
        first, *rest = logits.split_with_sizes(sizes, -1)
        if available is not None:
            first = first.masked_fill(available == 0, HIDDEN)
        parts = [torch.log_softmax(part, -1) for part in (first, *rest)]
        return cls(torch.cat(parts, -1), sizes, uses)

    @property
    def n_actions(self) -> int:
        """A."""
        return self.log_probs.shape[-1]

    @property
    def factors(self) -> tuple[Tensor, ...]:
        """The log π_p(·|s) of each number, (P,) of (S, B, size)."""
        return self.log_probs.split_with_sizes(self.sizes, -1)

    def log_prob(self, actions: Tensor) -> Tensor:
        """Return log π(a|s), (S, B), of actions (S, B, P) int64."""
        chosen = [
            part.gather(-1, number.unsqueeze(-1)).squeeze(-1)
            for part, number in zip(self.factors, actions.unbind(-1), strict=True)
        ]
        weights = self.uses[actions[..., 0]]  # (S, B, P − 1)
        return self._total(chosen, weights)

    def entropy(self) -> Tensor:
        """Return the entropy of what counts, (S, B)."""
        return self.cross_entropy(self)

    def cross_entropy(self, other: "Distribution") -> Tensor:
        """Return H(self‖other), (S, B); self is the teacher T.

        H(T‖π) = H(T₀‖π₀) + Σ_p U_p·H(T_p‖π_p),   U_p = Σ_c T₀(c|s)·u_cp
        """
        assert isinstance(other, Compound)
        terms = [
            -(torch.exp(own) * others).sum(-1)
            for own, others in zip(self.factors, other.factors, strict=True)
        ]
        return self._total(terms, self.chances_of_use())

    def chances_of_use(self) -> Tensor:
        """Return U, how likely each further number counts, (S, B, P − 1)."""
        return torch.exp(self.factors[0]) @ self.uses

    @staticmethod
    def _total(terms: Sequence[Tensor], weights: Tensor) -> Tensor:
        """Return the first term and the weighted others, in this order, (S, B)."""
        total = terms[0]
        for p, term in enumerate(terms[1:]):
            total = total + weights[..., p] * term
        return total

    def kl(self, other: "Distribution") -> Tensor:
        """Return KL(self‖other) = H(self‖other) − H(self), (S, B)."""
        return self.cross_entropy(other) - self.entropy()

    def sample(self, noise: Tensor) -> Tensor:
        """Return actions (S, B, P): of each number the largest of log π plus Gumbel noise."""
        return self._best(self.log_probs + noise)

    def mode(self) -> Tensor:
        """Return the most likely command and the most likely further numbers, (S, B, P)."""
        return self._best(self.log_probs)

    def _best(self, scores: Tensor) -> Tensor:
        return torch.stack(
            [part.argmax(-1) for part in scores.split_with_sizes(self.sizes, -1)], -1
        )

    def soften(self, min_std: float, temperature: float) -> "Compound":
        """Return the distribution at a temperature: each log π_p / temperature, normalised."""
        if temperature == 1:
            return self
        return self.from_logits(self.log_probs / temperature, self.sizes, self.uses)

    @staticmethod
    def noise(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
        """Draw the noise that `sample` takes."""
        return rng.gumbel(size=shape).astype(np.float32)

    def __getitem__(self, rows: tuple[Tensor, Tensor]) -> "Compound":
        return replace(self, log_probs=self.log_probs[rows])

    def alone(self, seed: int, n: int) -> "Compound":
        """Return one seed's policy at its first n samples, S = 1."""
        return replace(self, log_probs=self.log_probs[seed : seed + 1, :n])


def mixture_of_compounds(parts: Sequence[Compound], shares: Tensor) -> Compound:
    """Return T with Σᵢ wᵢ·H(Tᵢ‖π) = H(T‖π) for every compound π.

    T₀ is the mixture of the commands; a further number's distribution is that of the teachers who
    use it, weighted by how likely they do:

        T_p = Σᵢ wᵢ·U_pᵢ·T_pᵢ / Σᵢ wᵢ·U_pᵢ

    Args:
        parts: M teachers at the same samples, of whose actions the same numbers count.
        shares: w of each, (M, S, 1, 1), with the sum 1.
    """
    assert all(torch.equal(part.uses, parts[0].uses) for part in parts)
    first, *rest = zip(*(part.factors for part in parts), strict=True)
    chances = torch.stack([part.chances_of_use() for part in parts])  # (M, S, B, P − 1)
    mixed = [torch.logsumexp(torch.stack(list(first)) + shares.log(), 0)]
    for weights, number in _with_weights(rest, chances * shares):
        mixed.append(torch.logsumexp(torch.stack(list(number)) + weights.log(), 0))
    return replace(parts[0], log_probs=torch.cat(mixed, -1))


def _with_weights(
    numbers: Sequence[Sequence[Tensor]], weights: Tensor
) -> Iterator[tuple[Tensor, Sequence[Tensor]]]:
    """Yield each further number's weights (M, S, B, 1), with the sum 1, and its distributions."""
    equal = torch.full_like(weights[..., :1], 1 / len(weights))
    for p, number in enumerate(numbers):
        own = weights[..., p : p + 1]
        total = own.sum(0)
        yield torch.where(total > 0, own / total, equal), number
