"""Small dense networks as compiled code sees them: records of plain arrays and numbers.

Shapes: n samples of a seed, b of them in a minibatch, O observation, A actions, P parameters of a
tower, which is a policy or a critic.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from repaint_cli.learn.optimizer import EPSILON, RowAdam
from repaint_cli.nets import ActorCritic


class Tower(NamedTuple):
    """A policy or a critic of one seed: views into the flat buffers, and room for a minibatch."""

    weights: tuple[np.ndarray, ...]
    """(in, out) of each layer, the head last."""
    weight_gradients: tuple[np.ndarray, ...]
    """(in, out) each."""
    biases: tuple[np.ndarray, ...]
    """(out,) each."""
    bias_gradients: tuple[np.ndarray, ...]
    """(out,) each."""
    outputs: tuple[np.ndarray, ...]
    """Room for what each layer puts out, (b, out) each."""
    slopes: tuple[np.ndarray, ...]
    """Room for ∂L/∂(x·W + b) of each layer, (b, out) each."""


class Row(NamedTuple):
    """The same tower as Adam sees it, flat."""

    parameters: np.ndarray
    """θ, (P,)."""
    gradients: np.ndarray
    """∂L/∂θ, (P,)."""
    first: np.ndarray
    """Adam's first moments, (P,)."""
    second: np.ndarray
    """Adam's second moments, (P,)."""
    steps: int
    """Steps taken before."""
    learning_rate: float
    """Adam's step size."""
    epsilon: float
    """Adam's ε."""


class Batch(NamedTuple):
    """What one seed learns from, (n, …) each."""

    obs: np.ndarray
    """Normalised observations, (n, O)."""
    order: np.ndarray
    """The order of the samples in every epoch, (epochs, n)."""
    size: int
    """Samples per minibatch; the remainder of an epoch is a smaller one."""


class Choices(NamedTuple):
    """What was done at each sample, and what the teacher would do."""

    discrete: bool
    """Whether the policy is categorical; otherwise it is Gaussian."""
    actions: np.ndarray
    """a, (n, A); a one-hot row where discrete."""
    behavior_log_probs: np.ndarray
    """log μ(a|s), (n,)."""
    advantages: np.ndarray
    """Â, (n,)."""
    teacher: np.ndarray
    """The teacher's mean, or log-probabilities, (n, A)."""
    teacher_log_std: np.ndarray
    """log τ of a Gaussian teacher, (A,)."""
    clip_range: float
    """ε of the clipped surrogate."""
    ent_coef: float
    """Weight of the entropy bonus."""
    beta: float
    """β_k, weight of the cross-entropy."""


@dataclass(frozen=True)
class Place:
    """One seed's place in the flat buffers."""

    student: ActorCritic
    """Whose parameters."""
    optimizer: RowAdam
    """Whose moments."""
    s: int
    """Which seed, counted from 0."""
    scale: float
    """Of the learning rate."""

    def leaf(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return a parameter and its gradient."""
        leaf = self.student.weights[name]
        assert leaf.grad is not None
        return leaf.detach()[self.s].numpy(), leaf.grad[self.s].numpy()

    def tower(self, name: str, size: int) -> Tower:
        """Return a policy or a critic, with room for a minibatch of `size`."""
        layers = [f"{name}.{layer}" for layer in (*range(len(self.student.net.hidden)), "head")]
        weights = [self.leaf(f"{layer}.weight") for layer in layers]
        biases = [self.leaf(f"{layer}.bias") for layer in layers]
        rooms = [
            tuple(np.zeros((size, len(bias)), np.float32) for bias, _ in biases) for _ in range(2)
        ]
        return Tower(
            *map(tuple, zip(*weights, strict=True)), *map(tuple, zip(*biases, strict=True)), *rooms
        )

    def row(self, half: int) -> Row:
        """Return a policy (half 0) or a critic (1) as Adam sees it."""
        student, optimizer, cut = self.student, self.optimizer, self.student.n_policy
        place = (self.s, (slice(None, cut), slice(cut, None))[half])
        flat = (student.storage, student.gradients, optimizer.first, optimizer.second)
        parameters, gradients, first, second = (buffer[place].numpy() for buffer in flat)
        steps, rate = int(optimizer.steps[half, self.s]), optimizer.learning_rate * self.scale
        return Row(parameters, gradients, first, second, steps, rate, EPSILON)
