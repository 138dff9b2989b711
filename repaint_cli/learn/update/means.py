"""Means of metrics over the steps of an update."""

import numpy as np
import torch
from torch import Tensor


class Means:
    """Each seed's means of metrics over the gradient steps it took part in."""

    def __init__(self) -> None:
        self._steps: dict[str, list[tuple[Tensor, Tensor]]] = {}

    def add(self, counts: Tensor, metrics: dict[str, Tensor], active: Tensor | None = None) -> None:
        """Add the metrics of a step, (S,) each; seeds whose count is 0 took no part in it.

        Policies that are not `active`, (S,), took none either; the value loss is the critics'.
        """
        of_policies = counts if active is None else counts * active
        for name, values in metrics.items():
            took_part = counts if name == "value_loss" else of_policies
            self._steps.setdefault(name, []).append((took_part, values.detach()))

    def numpy(self) -> dict[str, np.ndarray]:
        """Return the means, (S,) each; nan for a seed that took no step."""
        means = {}
        for name, steps in self._steps.items():
            counts, values = map(torch.stack, zip(*steps, strict=True))  # (steps, S)
            took_part = counts > 0
            means[name] = (values.where(took_part, 0.0).sum(0) / took_part.sum(0)).numpy()
        return means
