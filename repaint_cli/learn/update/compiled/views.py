"""Where one seed's small dense networks lie in the flat buffers, as compiled code is given them."""

from dataclasses import dataclass

import numpy as np

from repaint_cli.learn.update.adam import EPSILON, RowAdam
from repaint_cli.learn.update.compiled.kernels import Row, Tower
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.parameters import NetworkName


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

    def tower(self, name: NetworkName, size: int) -> Tower:
        """Return a policy or a critic, with room for a minibatch of `size`."""
        n_hidden = len(self.student.net.widths(name))
        layers = [f"{name}.{layer}" for layer in (*range(n_hidden), "head")]
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
