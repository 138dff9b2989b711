"""Views of one seed's small dense networks in the flat buffers, as compiled code is given them."""

from collections.abc import Sequence
from math import inf

import numpy as np

from repaint_cli.learn.update.adam import EPSILON, RowAdam
from repaint_cli.learn.update.compiled.kernels import AdamView, NetworkView
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.parameters import NetworkName


def leaf_view(student: ActorCritic, s: int, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return seed number s's part of a parameter, and of its gradient."""
    leaf = student.weights[name]
    assert leaf.grad is not None
    return leaf.detach()[s].numpy(), leaf.grad[s].numpy()


def network_view(student: ActorCritic, s: int, tower: NetworkName, size: int) -> NetworkView:
    """Return seed number s's policy or critic, with the workspace for a minibatch of `size`."""
    n_hidden = len(student.net.widths(tower))
    layers = [f"{tower}.{layer}" for layer in (*range(n_hidden), "head")]
    weights, weight_gradients = _leaf_views(student, s, [f"{layer}.weight" for layer in layers])
    biases, bias_gradients = _leaf_views(student, s, [f"{layer}.bias" for layer in layers])
    inputs = np.empty((size, student.spaces.obs_shape[0]), np.float32)
    outputs, slopes = (
        tuple(np.zeros((size, len(bias)), np.float32) for bias in biases) for _ in range(2)
    )
    return NetworkView(
        weights, weight_gradients, biases, bias_gradients, inputs, outputs, slopes
    )  # fmt: skip


def _leaf_views(
    student: ActorCritic, s: int, names: Sequence[str]
) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
    """Return seed number s's part of several parameters, and of their gradients."""
    values, gradients = zip(*(leaf_view(student, s, name) for name in names), strict=True)
    return values, gradients


def adam_view(
    student: ActorCritic,
    optimizer: RowAdam,
    s: int,
    tower: NetworkName,
    scale: float,
    max_grad_norm: float | None,
) -> AdamView:
    """Return seed number s's policy or critic as Adam reads it, at `scale` times its step size."""
    cut, critic = student.n_policy, tower == "value"
    half = (s, slice(cut, None) if critic else slice(None, cut))
    buffers = (student.storage, student.gradients, optimizer.first, optimizer.second)
    parameters, gradients, first, second = (buffer[half].numpy() for buffer in buffers)
    steps, rate = int(optimizer.steps[int(critic), s]), optimizer.learning_rate * scale
    longest = inf if max_grad_norm is None else max_grad_norm
    return AdamView(parameters, gradients, first, second, steps, rate, EPSILON, longest)
