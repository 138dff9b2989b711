"""Means of metrics over the steps of an update."""

import numpy as np
import torch
from torch import Tensor

from repaint_cli.errors import DivergedError
from repaint_cli.policies.devices import HOST


class Means:
    """Each seed's means of metrics over the gradient steps it took part in."""

    def __init__(self) -> None:
        self._steps: dict[str, list[tuple[Tensor, Tensor]]] = {}
        self._losses: list[tuple[Tensor, dict[str, Tensor]]] = []

    def add(self, counts: Tensor, metrics: dict[str, Tensor], active: Tensor | None = None) -> None:
        """Add the metrics of a step, (S,) each; seeds whose count is 0 took no part in it.

        Policies that are not `active`, (S,), took none either; the value loss is the critics'.
        """
        of_policies = counts if active is None else counts * active
        for name, values in metrics.items():
            took_part = counts if name == "value_loss" else of_policies
            self._steps.setdefault(name, []).append((took_part, values.detach()))

    def watch(self, loss: Tensor, metrics: dict[str, Tensor]) -> None:
        """Check a step's loss, (S,), by its parts; on a GPU, which would be waited for, later.

        Raises:
            DivergedError: see `check_finite`.
        """
        if loss.device == HOST:
            _check_finite(loss, metrics)
        else:
            parts = {name: values.detach() for name, values in metrics.items()}
            self._losses.append((loss.detach(), parts))

    def check_finite(self) -> None:
        """Check the losses since the last check; to be asked once an epoch.

        Raises:
            DivergedError: one is not finite; it names the first of its parts that is not.
        """
        losses, self._losses = self._losses, []
        if losses and not torch.isfinite(torch.stack([loss for loss, _ in losses])).all():
            for loss, metrics in losses:
                _check_finite(loss, metrics)

    def numpy(self) -> dict[str, np.ndarray]:
        """Return the means, (S,) each; nan for a seed that took no step."""
        means = {}
        for name, steps in self._steps.items():
            counts, values = map(torch.stack, zip(*steps, strict=True))  # (steps, S)
            took_part, values = (counts > 0).cpu(), values.cpu()
            means[name] = (values.where(took_part, 0.0).sum(0) / took_part.sum(0)).numpy()
        return means


def _check_finite(loss: Tensor, metrics: dict[str, Tensor]) -> None:
    """Check each seed's loss (S,); name the first of its parts that is not finite."""
    finite = torch.isfinite(loss)
    if finite.all():
        return
    s = int((~finite).nonzero()[0])
    name = next((n for n, values in metrics.items() if not torch.isfinite(values[s])), "loss")
    raise DivergedError.of_loss(name, metrics.get(name, loss)[s].item(), s)
