"""A policy at a state: a diagonal Gaussian, a categorical or a compound one over actions.

Shapes: S seeds, B samples, A action size (Gaussian) or number of actions (categorical). Randomness
is an argument, `noise`, so that every seed has its own generator and sampling is a pure function.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import log, pi
from typing import TypeAlias

import numpy as np
import torch
from torch import Tensor

from repaint_cli.policies.compound import Compound, mixture_of_compounds
from repaint_cli.policies.devices import OnDevice
from repaint_cli.symmetry import SignedPermutation


@dataclass(frozen=True)
class Gaussian(OnDevice):
    """A Gaussian with independent dimensions, N(μ, σ²)."""

    mean: Tensor
    """μ, (S, B, A)."""
    log_std: Tensor
    """log σ, (S, 1, A): the same in every state; (S, B, A) of several policies in one."""

    @property
    def n_actions(self) -> int:
        """A."""
        return self.mean.shape[-1]

    def log_prob(self, actions: Tensor) -> Tensor:
        """Return log π(a|s), (S, B), of actions (S, B, A)."""
        z = (actions - self.mean) * torch.exp(-self.log_std)
        return (-0.5 * z * z - self.log_std - 0.5 * log(2 * pi)).sum(-1)

    def entropy(self) -> Tensor:
        """Return the differential entropy, (S, 1): it depends on the state only if σ does."""
        return (self.log_std + 0.5 * log(2 * pi * np.e)).sum(-1)

    def cross_entropy(self, other: "Distribution") -> Tensor:
        """Return H(self‖other), (S, B), in closed form; self is the teacher T with μ = m, σ = τ.

        H(T‖π) = Σ_d [½·log(2πσ_d²) + (τ_d² + (m_d − μ_d)²) / (2σ_d²)]
        """
        assert isinstance(other, Gaussian)
        spread = torch.exp(2 * self.log_std) + (self.mean - other.mean) ** 2  # (S, B, A)
        scaled = 0.5 * spread * torch.exp(-2 * other.log_std)
        return (other.log_std + 0.5 * log(2 * pi) + scaled).sum(-1)

    def kl(self, other: "Distribution") -> Tensor:
        """Return KL(self‖other) = H(self‖other) − H(self), (S, B)."""
        return self.cross_entropy(other) - self.entropy()

    def sample(self, noise: Tensor) -> Tensor:
        """Return actions μ + σ·noise, (S, B, A), from standard normal noise of that shape."""
        return self.mean + torch.exp(self.log_std) * noise

    def mode(self) -> Tensor:
        """Return the most likely actions, (S, B, A)."""
        return self.mean

    def soften(self, min_std: float, temperature: float) -> "Gaussian":
        """Return the distribution with no σ below `min_std`."""
        if min_std == 0:
            return self
        return Gaussian(self.mean, self.log_std.clamp(min=log(min_std)))

    def mirrored(self, actions: SignedPermutation) -> "Gaussian":
        """Return the distribution of mirrored actions."""
        return Gaussian(actions(self.mean), self.log_std[..., list(actions.order)])

    @staticmethod
    def noise(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
        """Draw the noise that `sample` takes."""
        return rng.standard_normal(shape, dtype=np.float32)

    def __getitem__(self, rows: tuple[Tensor, Tensor]) -> "Gaussian":
        same = self.log_std.shape[1] == 1
        return Gaussian(self.mean[rows], self.log_std if same else self.log_std[rows])

    def alone(self, seed: int, n: int) -> "Gaussian":
        """Return one seed's policy at its first n samples, S = 1."""
        row = slice(seed, seed + 1)
        same = self.log_std.shape[1] == 1
        return Gaussian(self.mean[row, :n], self.log_std[row, : 1 if same else n])


@dataclass(frozen=True)
class Categorical(OnDevice):
    """A distribution over A actions."""

    log_probs: Tensor
    """log π(·|s), (S, B, A), normalised."""

    @classmethod
    def from_logits(cls, logits: Tensor) -> "Categorical":
        """Normalise logits (S, B, A)."""
        return cls(torch.log_softmax(logits, -1))

    @property
    def n_actions(self) -> int:
        """A."""
        return self.log_probs.shape[-1]

    def log_prob(self, actions: Tensor) -> Tensor:
        """Return log π(a|s), (S, B), of actions (S, B) int64."""
        return self.log_probs.gather(-1, actions.unsqueeze(-1)).squeeze(-1)

    def entropy(self) -> Tensor:
        """Return the entropy, (S, B)."""
        return self.cross_entropy(self)

    def cross_entropy(self, other: "Distribution") -> Tensor:
        """Return H(self‖other) = −Σ_a T(a|s)·log π(a|s), (S, B); self is the teacher T."""
        assert isinstance(other, Categorical)
        return -(torch.exp(self.log_probs) * other.log_probs).sum(-1)

    def kl(self, other: "Distribution") -> Tensor:
        """Return KL(self‖other) = H(self‖other) − H(self), (S, B)."""
        return self.cross_entropy(other) - self.entropy()

    def sample(self, noise: Tensor) -> Tensor:
        """Return actions (S, B), the largest of log π plus Gumbel noise (S, B, A)."""
        return (self.log_probs + noise).argmax(-1)

    def mode(self) -> Tensor:
        """Return the most likely actions, (S, B)."""
        return self.log_probs.argmax(-1)

    def soften(self, min_std: float, temperature: float) -> "Categorical":
        """Return the distribution at a temperature: log π / temperature, normalised again."""
        return self if temperature == 1 else Categorical.from_logits(self.log_probs / temperature)

    def mirrored(self, actions: SignedPermutation) -> "Categorical":
        """Return the distribution of mirrored actions, which are numbered."""
        return Categorical(actions(self.log_probs))

    @staticmethod
    def noise(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
        """Draw the noise that `sample` takes."""
        return rng.gumbel(size=shape).astype(np.float32)

    def __getitem__(self, rows: tuple[Tensor, Tensor]) -> "Categorical":
        return Categorical(self.log_probs[rows])

    def alone(self, seed: int, n: int) -> "Categorical":
        """Return one seed's policy at its first n samples, S = 1."""
        return Categorical(self.log_probs[seed : seed + 1, :n])


Distribution: TypeAlias = Gaussian | Categorical | Compound


def concat_samples(parts: Sequence[Distribution]) -> Distribution:
    """Return one policy at the samples of all parts, (S, ΣB), without gradients."""
    first = parts[0]
    if isinstance(first, Gaussian):
        gaussians, log_std = [part for part in parts if isinstance(part, Gaussian)], first.log_std
        if log_std.shape[1] != 1:  # it depends on the state
            log_std = torch.cat([part.log_std for part in gaussians], 1)
        return Gaussian(torch.cat([part.mean for part in gaussians], 1).detach(), log_std.detach())
    log_probs = [part.log_probs for part in parts if not isinstance(part, Gaussian)]
    return replace(first, log_probs=torch.cat(log_probs, 1).detach())


def concat_policies(parts: Sequence[Distribution]) -> Distribution:
    """Return several policies, each at its own samples, (S, ΣB)."""
    whole = concat_samples(parts)
    if not isinstance(whole, Gaussian):
        return whole
    log_stds = [part.log_std.expand_as(part.mean) for part in parts if isinstance(part, Gaussian)]
    return Gaussian(whole.mean, torch.cat(log_stds, 1))


def mixture(parts: Sequence[Distribution], weights: Tensor) -> Distribution:
    """Return the distribution T that replaces several teachers at the same samples, (S, B).

        Σᵢ βᵢ·H(Tᵢ‖π) = (Σᵢ βᵢ)·H(T‖π)   for every π of the family      (paper, equation 5)

    as H(T‖π) is linear in T's probabilities or, where π is Gaussian, in T's first two moments: T is
    the mixture, or the Gaussian with its mean and its variance; see `mixture_of_compounds`.

    Args:
        parts: M teachers.
        weights: β of each, (M, S), not negative; where all are 0 it does not matter what T is.
    """
    if len(parts) == 1:
        return parts[0]
    total = weights.sum(0)
    shares = torch.where(total > 0, weights / total, 1 / len(parts)).float()[:, :, None, None]
    if isinstance(parts[0], Categorical):
        probs = [p.log_probs for p in parts if isinstance(p, Categorical)]
        return Categorical(torch.logsumexp(torch.stack(probs) + shares.log(), 0))
    if isinstance(parts[0], Compound):
        return mixture_of_compounds([p for p in parts if isinstance(p, Compound)], shares)
    pairs = [(p, w) for p, w in zip(parts, shares, strict=True) if isinstance(p, Gaussian)]
    mean = sum((w * p.mean for p, w in pairs), torch.zeros(()))
    # Var = Σ wᵢ·(τᵢ² + (mᵢ − m)²): no difference of large numbers
    spread = [w * (torch.exp(2 * p.log_std) + (p.mean - mean) ** 2) for p, w in pairs]
    return Gaussian(mean, 0.5 * torch.log(sum(spread, torch.zeros(()))))
