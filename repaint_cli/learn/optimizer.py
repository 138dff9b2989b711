"""Adam that moves some seeds' policies or critics and leaves the rest exactly where they are."""

from collections.abc import Sequence

import torch
from torch import Tensor

from repaint_cli.nets import ActorCritic

EPSILON = 1e-5
"""Adam's ε, as PPO has it."""


class RowAdam:
    """Adam over 2S rows, a policy and a critic per seed, each with its own count of steps.

    A row that is left out of a step is frozen exactly: neither its weights nor its moments move.
    That one mechanism serves "this seed has no minibatch left" and "teacher samples do not touch
    the critic".
    """

    def __init__(self, student: ActorCritic, learning_rate: float) -> None:
        cut, n_seeds = student.n_policy, student.n_seeds
        self.first, self.second = (
            torch.zeros_like(student.storage),
            torch.zeros_like(student.storage),
        )
        self.steps = torch.zeros(2, n_seeds)
        places = [
            (s, half) for half in (slice(None, cut), slice(cut, None)) for s in range(n_seeds)
        ]
        self._rows = [torch.nn.Parameter(student.storage[place]) for place in places]
        self._gradients = [student.gradients[place] for place in places]
        self._adam = torch.optim.Adam(self._rows, learning_rate, eps=EPSILON, fused=True)
        for row, place, step in zip(self._rows, places, self.steps.view(-1), strict=True):
            self._adam.state[row] = {
                "step": step, "exp_avg": self.first[place], "exp_avg_sq": self.second[place]
            }  # fmt: skip
        self.learning_rate = learning_rate

    def step(self, policies: Sequence[bool], critics: Sequence[bool], scale: float = 1.0) -> None:
        """Move the named policies and critics, (S,) each, at `scale` times the learning rate."""
        self._adam.param_groups[0]["lr"] = self.learning_rate * scale
        moving = [*policies, *critics]
        for row, gradient, moves in zip(self._rows, self._gradients, moving, strict=True):
            row.grad = gradient if moves else None
        self._adam.step()

    def state(self) -> dict[str, Tensor]:
        """Return the moments, (S, P) each, and how many steps policies and critics took, (2, S)."""
        return {"first": self.first, "second": self.second, "steps": self.steps}

    def load(self, state: dict[str, Tensor]) -> None:
        """Put moments and step counts in place."""
        for name, tensor in self.state().items():
            tensor.copy_(state[name])
