"""Policy and critic networks whose parameters carry a seed axis.

S seeds train side by side and stay independent. All parameters lie in one buffer (S, P); each row
is [everything π uses | everything only V uses], and every layer's weight is a view into it, as is
its gradient into a second buffer. Freezing a seed's policy or critic is leaving its half row out of
the optimiser's step.
"""

import warnings
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from math import inf, prod, sqrt
from operator import add
from typing import Any, Literal

import numpy as np
import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

from repaint_cli.errors import CardError
from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.distributions import Categorical, Distribution, Gaussian
from repaint_cli.policies.normalizer import Normalizer
from repaint_cli.policies.spaces import Spaces

Tower = Literal["policy", "value"]

ACTIVATIONS = {"tanh": torch.tanh, "relu": torch.relu, "elu": F.elu}
"""What may follow a dense layer, by its name on a card."""

LIDAR = (256, 256)
"""Widths of the ReLU layers that read a lidar, beside the convolutions."""

# The gradients are views into one buffer on purpose: one fill zeroes them, one row is a seed's.
warnings.filterwarnings("ignore", message="grad and param do not obey the gradient layout contract")


@dataclass(frozen=True)
class Leaf:
    """One parameter of the network, before it has a place."""

    name: str
    shape: tuple[int, ...]
    gain: float
    """Scale of the orthogonal initialisation; 0 is all zeros."""


class ActorCritic:
    """S policies and S critics of one shape.

    Layers are orthogonal at the start (gain √2, the heads 0.01 and 1), biases and log σ are 0.
    """

    def __init__(self, spaces: Spaces, net: NetConfig, n_seeds: int) -> None:
        self.spaces, self.net, self.n_seeds = spaces, net, n_seeds
        towers = leaves_of(spaces, net)
        self.leaves = towers["policy"] + towers["value"]
        self.n_policy = sum(prod(leaf.shape) for leaf in towers["policy"])
        total = sum(prod(leaf.shape) for leaf in self.leaves)
        self.storage = torch.zeros(n_seeds, total)
        self.gradients = torch.zeros(n_seeds, total)
        self.weights = dict(self._views())
        self._own = dict(self._seed_by_seed()) if spaces.image else {}
        clip = inf if net.obs_clip == "none" else net.obs_clip
        vector = (n_seeds, spaces.obs_shape[0], clip, net.obs_min_std)
        self.normalizer = None if spaces.image else Normalizer(*vector)

    def _views(self) -> Iterator[tuple[str, Tensor]]:
        start = 0
        for leaf in self.leaves:
            stop = start + prod(leaf.shape)
            shape = (self.n_seeds, *leaf.shape)
            weight = self.storage[:, start:stop].view(shape).detach().requires_grad_()
            weight.grad = self.gradients[:, start:stop].view(shape)
            yield leaf.name, weight
            start = stop

    def _seed_by_seed(self) -> Iterator[tuple[str, list[Tensor]]]:
        """Name each seed's own parameters: a stacked one's row costs a copy of all, backwards."""
        for name, stacked in self.weights.items():
            assert stacked.grad is not None
            rows = [row.detach().requires_grad_() for row in stacked.detach()]
            for row, gradient in zip(rows, stacked.grad, strict=True):
                row.grad = gradient
            yield name, rows

    def initialize(self, rngs: Sequence[np.random.Generator]) -> None:
        """Draw every seed's first parameters from its own generator."""
        for leaf in self.leaves:
            for s, rng in enumerate(rngs):
                if leaf.gain:
                    drawn = torch.from_numpy(_orthogonal(rng, leaf.shape, leaf.gain))
                    self.weights[leaf.name].data[s] = drawn

    def policy(self, obs: Any, counts: Sequence[int] | None = None) -> Distribution:
        """Return π(·|s) for raw observations (S, B, *O).

        Args:
            obs: observations, or {"camera": …, "lidar": …}; each seed's first `counts[s]` are real,
                the rest is padding.
            counts: how many are real, (S,); all where absent. Images beyond are not looked at.
        """
        out = self._forward("policy", obs, counts)
        if self.spaces.discrete:
            return Categorical.from_logits(out)
        return Gaussian(out, self.weights["policy.log_std"].unsqueeze(1))

    def q_values(self, obs: Any, counts: Sequence[int] | None = None) -> Tensor:
        """Return Q(s, ·), (S, B, A): what a policy over numbered actions has as its logits."""
        return self._forward("policy", obs, counts)

    def value(self, obs: Any, counts: Sequence[int] | None = None) -> Tensor:
        """Return V(s), (S, B), for raw observations (S, B, *O); see `policy`."""
        return self._forward("value", obs, counts).squeeze(-1)

    def _forward(self, tower: Tower, obs: Any, counts: Sequence[int] | None) -> Tensor:
        if self.normalizer is None:
            return self._convolve(tower, obs, counts)
        x, bend = self.normalizer.normalize(obs), ACTIVATIONS[self.net.activation]
        for layer in range(len(self.net.widths(tower))):
            x = bend(self._dense(x, f"{tower}.{layer}"))
        return self._dense(x, f"{tower}.head")

    def _dense(self, x: Tensor, name: str) -> Tensor:
        weight, bias = self.weights[f"{name}.weight"], self.weights[f"{name}.bias"]
        return torch.baddbmm(bias.unsqueeze(1), x, weight)

    def _convolve(self, tower: Tower, obs: Any, counts: Sequence[int] | None) -> Tensor:
        """Run the camera network seed by seed: grouped convolutions measured slower."""
        images, ranges = (obs["camera"], obs["lidar"]) if self.spaces.n_beams else (obs, None)
        outs, most = [], images.shape[1]
        for s in range(self.n_seeds):
            n = most if counts is None else counts[s]
            beside = None if ranges is None else ranges[s, :n]
            out = self._see(tower, s, images[s, :n], beside)
            outs.append(F.pad(out, (0, 0, 0, most - out.shape[0])))
        return torch.stack(outs)  # (S, B, heads)

    def _see(self, tower: Tower, s: int, images: Tensor, ranges: Tensor | None) -> Tensor:
        eyes, shape = "policy" if self.net.shared else tower, self.net.eyes
        bend = torch.tanh if shape.tanh else torch.relu
        x = brightness(images, self.net.pool)
        for layer, (_, _, stride) in enumerate(shape.layers):
            name = f"{eyes}.conv{layer}"
            x = bend(
                F.conv2d(x, self._own[f"{name}.weight"][s], self._own[f"{name}.bias"][s], stride)
            )
        x = x.flatten(1)
        if shape.dense:
            x = bend(self._dense_of(s, x, f"{eyes}.embed"))
        if ranges is not None:
            near = 1 - ranges  # nothing within a metre is 0
            for layer in range(len(LIDAR)):
                near = torch.relu(self._dense_of(s, near, f"{eyes}.lidar{layer}"))
            x = torch.cat([x, near], 1)
        x = torch.relu(self._dense_of(s, x, f"{tower}.dense"))
        return self._dense_of(s, x, f"{tower}.head")

    def _dense_of(self, s: int, x: Tensor, name: str) -> Tensor:
        return torch.addmm(self._own[f"{name}.bias"][s], x, self._own[f"{name}.weight"][s])


def brightness(images: Tensor, pool: int) -> Tensor:
    """Return images (B, H, W, C) uint8 as numbers in [0, 1], (B, C, H/pool, W/pool).

    Squares of pool × pool pixels are averaged; adding strided views is what torch does fastest.
    """
    x = images.permute(0, 3, 1, 2).to(torch.float32)
    height, width = (size // pool * pool for size in x.shape[2:])
    x = reduce(add, [x[..., i:height:pool, :] for i in range(pool)])
    x = reduce(add, [x[..., i:width:pool] for i in range(pool)])
    return x / (255 * pool * pool)


def leaves_of(spaces: Spaces, net: NetConfig) -> dict[Tower, list[Leaf]]:
    """Return the parameters of a policy and of a critic, in order, before there are any.

    Raises:
        CardError: the networks do not read what the task gives.
    """
    if (net.kind == "cnn") != spaces.image:
        wanted = "an image" if net.kind == "cnn" else "a vector"
        raise CardError(f"net.kind '{net.kind}' reads {wanted}, the task gives {spaces}")
    towers: tuple[Tower, Tower] = ("policy", "value")
    return {tower: list(_tower(tower, spaces, net)) for tower in towers}


def _tower(tower: Tower, spaces: Spaces, net: NetConfig) -> Iterator[Leaf]:
    """Name the parameters of a policy or a critic, in order."""
    if spaces.image:
        size = yield from _eyes(tower, spaces, net)
        yield from _layer(f"{tower}.dense", size, net.dense, sqrt(2))
        size = net.dense
    else:
        size = spaces.obs_shape[0]
        for layer, width in enumerate(net.widths(tower)):
            yield from _layer(f"{tower}.{layer}", size, width, sqrt(2))
            size = width
    if tower == "value":
        yield from _layer("value.head", size, 1, 1.0)
    else:
        yield from _layer("policy.head", size, spaces.n_actions, 0.01)
        if not spaces.discrete:
            yield Leaf("policy.log_std", (spaces.n_actions,), 0.0)


def _eyes(tower: str, spaces: Spaces, net: NetConfig) -> Generator[Leaf, None, int]:
    """Name the convolutions and return how many numbers they put out."""
    height, width, channels = spaces.obs_shape
    height, width = height // net.pool, width // net.pool
    own = tower == "policy" or not net.shared
    for layer, (filters, kernel, stride) in enumerate(net.eyes.layers):
        if own:
            yield Leaf(f"{tower}.conv{layer}.weight", (filters, channels, kernel, kernel), sqrt(2))
            yield Leaf(f"{tower}.conv{layer}.bias", (filters,), 0.0)
        height, width = (height - kernel) // stride + 1, (width - kernel) // stride + 1
        channels = filters
        if min(height, width) < 1:
            raise CardError(
                f"net.conv layer {layer} needs a larger image: {spaces} at net.pool {net.pool}"
            )
    size = channels * height * width
    if net.eyes.dense:
        if own:
            yield from _layer(f"{tower}.embed", size, net.eyes.dense, sqrt(2))
        size = net.eyes.dense
    if not spaces.n_beams:
        return size
    n_in = spaces.n_beams
    for layer, width in enumerate(LIDAR):
        if own:
            yield from _layer(f"{tower}.lidar{layer}", n_in, width, sqrt(2))
        n_in = width
    return size + n_in


def _layer(name: str, n_in: int, n_out: int, gain: float) -> Iterator[Leaf]:
    yield Leaf(f"{name}.weight", (n_in, n_out), gain)
    yield Leaf(f"{name}.bias", (n_out,), 0.0)


def _orthogonal(rng: np.random.Generator, shape: tuple[int, ...], gain: float) -> np.ndarray:
    """Return a matrix with orthogonal rows or columns, times gain; a filter is a row."""
    rows, columns = (shape[0], prod(shape[1:]))
    drawn = rng.standard_normal((max(rows, columns), min(rows, columns)))
    q, r = np.linalg.qr(drawn)
    q = q * np.sign(np.diag(r))
    return (gain * (q if rows >= columns else q.T)).reshape(shape).astype(np.float32)
