"""Adam that moves some seeds' policies or critics and leaves the rest exactly where they are."""

from collections.abc import Sequence

import torch
from torch import Tensor

from repaint_cli.nets import ActorCritic


class RowAdam:
    """Adam over 2S rows, a policy and a critic per seed, each with its own count of steps.

    A row that is left out of a step is frozen exactly: neither its weights nor its moments move.
    That one mechanism serves "this seed has no minibatch left" and "teacher samples do not touch
    the critic".
    """

    def __init__(self, student: ActorCritic, learning_rate: float) -> None:
        cut, n_seeds = student.n_policy, student.n_seeds
        halves = [slice(None, cut)] * n_seeds + [slice(cut, None)] * n_seeds
        seeds = [*range(n_seeds), *range(n_seeds)]
        self.rows = [
            torch.nn.Parameter(student.storage[s, half])
            for s, half in zip(seeds, halves, strict=True)
        ]
        self._gradients = [student.gradients[s, h] for s, h in zip(seeds, halves, strict=True)]
        self._adam = torch.optim.Adam(self.rows, learning_rate, eps=1e-5, fused=True)
        self.learning_rate = learning_rate

    def step(self, policies: Sequence[bool], critics: Sequence[bool], scale: float = 1.0) -> None:
        """Move the named policies and critics, (S,) each, at `scale` times the learning rate."""
        self._adam.param_groups[0]["lr"] = self.learning_rate * scale
        moving = [*policies, *critics]
        for row, gradient, moves in zip(self.rows, self._gradients, moving, strict=True):
            row.grad = gradient if moves else None
        self._adam.step()

    def state(self) -> dict[str, Tensor]:
        """Return moments and step counts by row number."""
        states = self._adam.state_dict()["state"]
        return {
            f"{row}.{name}": value for row, parts in states.items() for name, value in parts.items()
        }

    def load(self, state: dict[str, Tensor]) -> None:
        """Put moments and step counts in place."""
        rows: dict[int, dict[str, Tensor]] = {}
        for key, value in state.items():
            row, _, name = key.partition(".")
            rows.setdefault(int(row), {})[name] = value
        self._adam.load_state_dict(self._adam.state_dict() | {"state": rows})
