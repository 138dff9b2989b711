"""The parameters of a policy and a critic: their names, shapes and first values.

Names are those of the leaves in a file of weights, so they never change.
"""

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from math import prod, sqrt
from typing import Literal

import numpy as np

from repaint_cli.errors import CardError
from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.spaces import Spaces
from repaint_cli.threads import blas

NetworkName = Literal["policy", "value"]

LIDAR_WIDTHS = (256, 256)
"""Of the ReLU layers that read a lidar, beside the convolutions."""

AVAILABLE = "available"
"""The vector of observations that says which commands can be carried out, (C,); see `net.mask`."""

LARGE = 2**20
"""Numbers of a matrix whose factorisation takes a second: the first dense layer of a camera."""


@dataclass(frozen=True)
class Leaf:
    """One parameter tensor of a network, before it is allocated."""

    name: str
    shape: tuple[int, ...]
    gain: float
    """Scale of the orthogonal initialisation; 0 is all zeros."""


def leaves_of(spaces: Spaces, net: NetConfig) -> dict[NetworkName, list[Leaf]]:
    """Return the parameters of a policy and of a critic, in order.

    Raises:
        CardError: the networks do not read the task's observations, or mask commands of which the
            task does not say whether they are available.
    """
    if (net.kind == "cnn") != spaces.image:
        wanted = "an image" if net.kind == "cnn" else "a vector"
        raise CardError(f"net.kind '{net.kind}' reads {wanted}, the task gives {spaces}")
    if net.mask and (not spaces.sizes or dict(spaces.parts).get(AVAILABLE) != spaces.sizes[:1]):
        raise CardError(
            f"net.mask needs observations '{AVAILABLE}', a number for each command, found {spaces}"
        )
    names: tuple[NetworkName, NetworkName] = ("policy", "value")
    return {name: list(_network(name, spaces, net)) for name in names}


def _network(name: NetworkName, spaces: Spaces, net: NetConfig) -> Iterator[Leaf]:
    """Yield the parameters of the policy or of the critic, in order."""
    if spaces.image:
        size = yield from _sensor_layers(name, spaces, net)
        if name == "policy" or net.shared != "all":
            yield from _dense(f"{name}.dense", size, net.dense, sqrt(2))
        size = net.dense
    else:
        size = spaces.obs_shape[0]
        for layer, width in enumerate(net.widths(name)):
            yield from _dense(f"{name}.{layer}", size, width, sqrt(2))
            size = width
    if name == "value":
        yield from _dense("value.head", size, 1, 1.0)
    else:
        yield from _dense("policy.head", size, spaces.n_actions, 0.01)
        if not spaces.discrete:
            yield Leaf("policy.log_std", (spaces.n_actions,), 0.0)


def images_of(spaces: Spaces) -> list[str]:
    """Return the names of the images among several observations."""
    return [name for name, shape in spaces.parts if len(shape) == 3]


def vectors_of(spaces: Spaces) -> list[str]:
    """Return the names of the vectors among several observations."""
    return [name for name, shape in spaces.parts if len(shape) == 1]


def _sensor_layers(name: NetworkName, spaces: Spaces, net: NetConfig) -> Generator[Leaf, None, int]:
    """Yield the parameters that read images and numbers beside them; return how many features.

    A critic that shares the policy's layers has none of its own.
    """
    layers: list[Leaf] = []
    if spaces.parts:
        shapes = dict(spaces.parts)
        images, n_in = images_of(spaces), sum(shapes[n][0] for n in vectors_of(spaces))
        size = sum(_add_conv_torso(layers, f"{name}.{one}", shapes[one], net) for one in images)
        if n_in:
            layers += _dense(f"{name}.vector", n_in, net.vector, sqrt(2))
            size += net.vector
    else:
        size = _add_conv_torso(layers, name, spaces.obs_shape, net)
    if spaces.n_beams:
        n_in = spaces.n_beams
        for layer, width in enumerate(LIDAR_WIDTHS):
            layers += _dense(f"{name}.lidar{layer}", n_in, width, sqrt(2))
            n_in = width
        size += n_in
    if name == "policy" or not net.shared:
        yield from layers
    return size


def _add_conv_torso(layers: list[Leaf], name: str, shape: tuple[int, ...], net: NetConfig) -> int:
    """Append the parameters of the convolutions; return their number of features.

    Raises:
        CardError: the image is smaller than a convolution's kernel.
    """
    height, width, channels = shape
    height, width = height // net.pool, width // net.pool
    for layer, (filters, kernel, stride) in enumerate(net.conv_torso.layers):
        form = (filters, channels, kernel, kernel)
        layers.append(Leaf(f"{name}.conv{layer}.weight", form, sqrt(2)))
        layers.append(Leaf(f"{name}.conv{layer}.bias", (filters,), 0.0))
        height, width = (height - kernel) // stride + 1, (width - kernel) // stride + 1
        channels = filters
        if min(height, width) < 1:
            raise CardError(
                f"net.conv layer {layer} needs a larger image: {'×'.join(map(str, shape))} at "
                f"net.pool {net.pool}"
            )
    size = channels * height * width
    if net.conv_torso.dense:
        layers += _dense(f"{name}.embed", size, net.conv_torso.dense, sqrt(2))
        size = net.conv_torso.dense
    return size


def _dense(name: str, n_in: int, n_out: int, gain: float) -> Iterator[Leaf]:
    yield Leaf(f"{name}.weight", (n_in, n_out), gain)
    yield Leaf(f"{name}.bias", (n_out,), 0.0)


def first_values(
    leaves: Sequence[Leaf], net: NetConfig, rng: np.random.Generator
) -> Iterator[tuple[str, np.ndarray]]:
    """Yield what parameters begin with, by name, float32; those that are left out are 0."""
    inputs = 1  # of the layer whose weight came last
    for leaf in leaves:
        if leaf.name.endswith(".weight"):
            dense = len(leaf.shape) == 2
            inputs = leaf.shape[0] if dense else prod(leaf.shape[1:])
        if net.init == "uniform" and leaf.name.endswith((".weight", ".bias")):
            bound = 1 / sqrt(inputs)
            yield leaf.name, rng.uniform(-bound, bound, leaf.shape).astype(np.float32)
        elif leaf.gain:
            yield leaf.name, orthogonal(rng, leaf.shape, leaf.gain)


def orthogonal(rng: np.random.Generator, shape: tuple[int, ...], gain: float) -> np.ndarray:
    """Draw a matrix with orthogonal rows or columns, times gain, float32; a filter is a row."""
    rows, columns = (shape[0], prod(shape[1:]))
    with blas().limit(limits=1):  # on a busy machine further threads wait by spinning, for seconds
        q = _orthonormal(rng.standard_normal((max(rows, columns), min(rows, columns))))
    return (gain * (q if rows >= columns else q.T)).reshape(shape).astype(np.float32)


def _orthonormal(drawn: np.ndarray) -> np.ndarray:
    """Return Q of drawn = Q·R, where the diagonal of R is positive; then Q is uniform (Haar).

    Of a large and tall matrix by drawnᵀ·drawn = Rᵀ·R, six times as fast: its columns are nearly at
    right angles (condition at most 3), so that Q is as exact as by Householder's reflections.
    """
    rows, columns = drawn.shape
    if drawn.size > LARGE and rows >= 4 * columns:
        lower = np.linalg.cholesky(drawn.T @ drawn)
        q: np.ndarray = drawn @ np.linalg.inv(lower).T
        return q
    q, r = np.linalg.qr(drawn)
    return q * np.sign(np.diag(r))
