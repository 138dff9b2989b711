"""The arithmetic of networks alone: passes in bare torch, on two cores that both work."""

from collections.abc import Callable
from functools import partial
from time import perf_counter

import torch
from torch import Tensor, nn

from repaint_cli.learn.side_by_side import side_by_side

Network = tuple[nn.Module, Callable[[], Tensor]]
"""Layers, and what passes a batch through them."""


def seconds_of_a_pass(make: Callable[[], Network], *, backward: bool, times: int) -> float:
    """Return the time of a pass, with its gradients or without, each of two cores with its own."""

    def passes(n: int) -> None:
        layers, forward = make()
        for _ in range(n):
            with torch.set_grad_enabled(backward):
                out = forward()
                if backward:
                    layers.zero_grad()
                    out.sum().backward()

    side_by_side([partial(passes, 2)] * 2)  # what is done once is not counted
    started = perf_counter()
    side_by_side([partial(passes, times)] * 2)
    return (perf_counter() - started) / times
