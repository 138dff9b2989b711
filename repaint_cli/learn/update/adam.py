"""Adam that moves some seeds' policies or critics and leaves the rest exactly where they are."""

from collections.abc import Sequence
from copy import copy
from typing import Any

import torch
from torch import Tensor
from torch.optim.adam import adam

from repaint_cli.policies.networks import ActorCritic

EPSILON = 1e-5
"""Adam's ε, as PPO has it."""

CLIP_EPSILON = 1e-6
"""Added to the norm of a gradient that is divided by it, as in torch."""


OF_INSTANCES = "instances/"
"""Before the names of moments that belong to L_ins alone."""

_Row = tuple[Tensor, ...]
"""Parameters, gradients, moments and the count of steps of a policy or a critic."""


def _clip(gradient: Tensor, max_norm: float) -> None:
    """Scale a gradient (P,) in place: g ← g·min(1, c/(‖g‖ + 10⁻⁶))."""
    gradient.mul_((max_norm / (gradient.norm() + CLIP_EPSILON)).clamp(max=1))


class _InstanceMoments:
    """What a joint update keeps of L_ins: gradients of the policies, and Adam's moments of them."""

    def __init__(self, student: ActorCritic) -> None:
        policies = student.storage[:, : student.n_policy]  # (S, P)
        self.gradients, self.first, self.second = (torch.zeros_like(policies) for _ in range(3))
        self.steps = torch.zeros(student.n_seeds, device=student.device)
        flat = (policies, self.gradients, self.first, self.second, self.steps)
        self.rows = [tuple(buffer[s] for buffer in flat) for s in range(student.n_seeds)]

    def alone(self, seed: int) -> "_InstanceMoments":
        """Return one seed's in the same memory."""
        one, row = copy(self), slice(seed, seed + 1)
        one.gradients, one.first, one.second = (
            self.gradients[row],
            self.first[row],
            self.second[row],
        )
        one.steps, one.rows = self.steps[row], self.rows[row]
        return one

    def state(self) -> dict[str, Tensor]:
        """Return the moments, (S, P) each, and the counts of steps, (S,)."""
        parts = {"first": self.first, "second": self.second, "steps": self.steps}
        return {OF_INSTANCES + name: tensor for name, tensor in parts.items()}


class RowAdam:
    """Adam over 2S rows, a policy and a critic per seed, each with its own count of steps.

    A row that is left out of a step is frozen exactly: neither its weights nor its moments move.
    That one mechanism serves "this seed has no minibatch left" and "teacher samples do not touch
    the critic".
    """

    def __init__(self, student: ActorCritic, learning_rate: float, *, joint: bool = False) -> None:
        """Begin with empty moments.

        Args:
            student: whose parameters move.
            learning_rate: the step size.
            joint: whether updates are joint, which takes moments of L_ins of their own.
        """
        cut, n_seeds = student.n_policy, student.n_seeds
        self.first, self.second = (torch.zeros_like(student.storage) for _ in range(2))
        self.steps = torch.zeros(2, n_seeds, device=student.device)
        flat = (student.storage, student.gradients, self.first, self.second)
        self._rows = [
            (*(buffer[s, half] for buffer in flat), self.steps[row, s])
            for row, half in enumerate((slice(None, cut), slice(cut, None)))
            for s in range(n_seeds)
        ]
        self.learning_rate = learning_rate
        self.of_instances = _InstanceMoments(student) if joint else None

    def alone(self, seed: int) -> "RowAdam":
        """Return one seed's optimiser in the same memory, at the same rate."""
        one, row = copy(self), slice(seed, seed + 1)
        one.first, one.second, one.steps = self.first[row], self.second[row], self.steps[:, row]
        one._rows = self._rows[seed :: self.steps.shape[1]]  # its policy and its critic
        one.of_instances = self.of_instances and self.of_instances.alone(seed)
        return one

    def step(
        self,
        policies: Sequence[bool],
        critics: Sequence[bool],
        scale: float = 1.0,
        max_grad_norm: float | None = None,
    ) -> None:
        """Move the named policies and critics, (S,) each; policies at `scale` times the rate.

        Gradients of theirs that are longer than `max_grad_norm` are scaled down to it, each by
        itself: its network has an optimiser of its own.
        """
        n = len(policies)
        if max_grad_norm is not None:
            for row, moves in zip(self._rows, [*policies, *critics], strict=True):
                if moves:
                    _clip(row[1], max_grad_norm)
        if scale == 1:
            self._move(self._rows, [*policies, *critics], 1.0)
        else:
            self._move(self._rows[:n], policies, scale)
            self._move(self._rows[n:], critics, 1.0)

    def step_on_instances(
        self, policies: Sequence[bool], scale: float, max_grad_norm: float | None = None
    ) -> None:
        """Move the named policies, (S,), by the kept gradients of L_ins at `scale` times the rate.

        The moments are those of L_ins alone, so that α₂ is a step size (paper, algorithm 1).
        """
        assert self.of_instances is not None
        for row, moves in zip(self.of_instances.rows, policies, strict=True):
            if moves and max_grad_norm is not None:
                _clip(row[1], max_grad_norm)
        self._move(self.of_instances.rows, policies, scale)

    def _move(self, named: Sequence[_Row], moving: Sequence[bool], scale: float) -> None:
        rows = [row for row, moves in zip(named, moving, strict=True) if moves]
        if not rows:
            return
        parameters, gradients, first, second, steps = map(list, zip(*rows, strict=True))
        # the fused kernel gives a long row to few of a GPU's processors; the host's code is one
        cuda = parameters[0].is_cuda
        how: Any = {"capturable": True, "foreach": False} if cuda else {"fused": True}
        with torch.no_grad():  # torch.optim.Adam's own arithmetic; the class imports a compiler
            adam(
                parameters, gradients, first, second, [], steps, **how, amsgrad=False,
                beta1=0.9, beta2=0.999, lr=self.learning_rate * scale, weight_decay=0.0,
                eps=EPSILON, maximize=False,
            )  # fmt: skip

    def state(self) -> dict[str, Tensor]:
        """Return the moments, (S, P) each, and how many steps policies and critics took, (2, S)."""
        state = {"first": self.first, "second": self.second, "steps": self.steps}
        return state | (self.of_instances.state() if self.of_instances else {})

    def load(self, state: dict[str, Tensor]) -> None:
        """Put moments and step counts in place.

        Raises:
            ValueError: a tensor has another shape: the state is of another network or other seeds.
        """
        for name, tensor in self.state().items():
            if name.startswith(OF_INSTANCES) and name not in state:
                continue  # of a run that was begun before these were kept: they begin empty
            if state[name].shape != tensor.shape:
                shape, expected = tuple(state[name].shape), tuple(tensor.shape)
                raise ValueError(f"the optimiser's {name} is {shape}, wanted {expected}")
            tensor.copy_(state[name])
