"""Policy and critic networks whose parameters carry a seed axis.

S seeds train side by side and stay independent. All parameters lie in one buffer (S, P); each row
is [everything π uses | everything only V uses], and every layer's weight is a view into it, as is
its gradient into a second buffer. Freezing a seed's policy or critic is leaving its half row out of
the optimiser's step.
"""

import warnings
from collections.abc import Iterator, Sequence
from functools import reduce
from math import inf, prod
from operator import add
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.distributions import Categorical, Distribution, Gaussian
from repaint_cli.policies.normalizer import Normalizer
from repaint_cli.policies.parameters import LIDAR_WIDTHS, NetworkName, leaves_of, orthogonal
from repaint_cli.policies.spaces import Spaces

ACTIVATIONS = {"tanh": torch.tanh, "relu": torch.relu, "elu": F.elu}
"""Of dense layers, by name on a card."""

# The gradients are views into one buffer on purpose: one fill zeroes them, one row is a seed's.
warnings.filterwarnings("ignore", message="grad and param do not obey the gradient layout contract")


class ActorCritic:
    """S policies and S critics of one shape.

    Layers are orthogonal at the start (gain √2, the heads 0.01 and 1), biases and log σ are 0.
    """

    def __init__(self, spaces: Spaces, net: NetConfig, n_seeds: int) -> None:
        self.spaces, self.net, self.n_seeds = spaces, net, n_seeds
        leaves = leaves_of(spaces, net)
        self.leaves = leaves["policy"] + leaves["value"]
        self.n_policy = sum(prod(leaf.shape) for leaf in leaves["policy"])
        total = sum(prod(leaf.shape) for leaf in self.leaves)
        self.storage = torch.zeros(n_seeds, total)
        self.gradients = torch.zeros(n_seeds, total)
        self.weights = dict(self._views())
        self._seed_weights = dict(self._split_by_seed()) if spaces.image else {}
        clip = inf if net.obs_clip == "none" else net.obs_clip
        self.normalizer = (
            None if spaces.image
            else Normalizer(n_seeds, spaces.obs_shape[0], clip, net.obs_min_std)
        )  # fmt: skip

    def _views(self) -> Iterator[tuple[str, Tensor]]:
        start = 0
        for leaf in self.leaves:
            stop = start + prod(leaf.shape)
            shape = (self.n_seeds, *leaf.shape)
            weight = self.storage[:, start:stop].view(shape).detach().requires_grad_()
            weight.grad = self.gradients[:, start:stop].view(shape)
            yield leaf.name, weight
            start = stop

    def _split_by_seed(self) -> Iterator[tuple[str, list[Tensor]]]:
        """Yield each parameter seed by seed: the gradient of a row would be a copy of all rows."""
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
                    drawn = torch.from_numpy(orthogonal(rng, leaf.shape, leaf.gain))
                    self.weights[leaf.name].data[s] = drawn
        if "policy.log_std" in self.weights:
            self.weights["policy.log_std"].data.fill_(self.net.log_std_init)

    def policy(self, obs: Any, counts: Sequence[int] | None = None) -> Distribution:
        """Return π(·|s) for raw observations (S, B, *O).

        Args:
            obs: observations, or {"camera": …, "lidar": …}; each seed's first `counts[s]` are real,
                the rest is padding.
            counts: how many are real, (S,); all where absent. Padding of images is not computed.
        """
        out = self._forward("policy", obs, counts)
        if self.spaces.discrete:
            return Categorical.from_logits(out)
        return Gaussian(out, self.weights["policy.log_std"].unsqueeze(1))

    def q_values(self, obs: Any, counts: Sequence[int] | None = None) -> Tensor:
        """Return Q(s, ·), (S, B, A): the logits of a policy over numbered actions."""
        return self._forward("policy", obs, counts)

    def value(self, obs: Any, counts: Sequence[int] | None = None) -> Tensor:
        """Return V(s), (S, B), for raw observations (S, B, *O); see `policy`."""
        return self._forward("value", obs, counts).squeeze(-1)

    def _forward(self, network: NetworkName, obs: Any, counts: Sequence[int] | None) -> Tensor:
        """Return the outputs of the policy's or the critic's head, (S, B, heads)."""
        if self.normalizer is None:
            return self._cnn(network, obs, counts)
        x, activation = self.normalizer.normalize(obs), ACTIVATIONS[self.net.activation]
        for layer in range(len(self.net.widths(network))):
            x = activation(self._dense(x, f"{network}.{layer}"))
        return self._dense(x, f"{network}.head")

    def _dense(self, x: Tensor, name: str) -> Tensor:
        weight, bias = self.weights[f"{name}.weight"], self.weights[f"{name}.bias"]
        return torch.baddbmm(bias.unsqueeze(1), x, weight)

    def _cnn(self, network: NetworkName, obs: Any, counts: Sequence[int] | None) -> Tensor:
        """Run the camera network seed by seed: grouped convolutions measured slower."""
        images, ranges = (obs["camera"], obs["lidar"]) if self.spaces.n_beams else (obs, None)
        outs, n_samples = [], images.shape[1]
        for s in range(self.n_seeds):
            n = n_samples if counts is None else counts[s]
            seed_ranges = None if ranges is None else ranges[s, :n]
            out = self._seed_cnn(network, s, images[s, :n], seed_ranges)
            outs.append(F.pad(out, (0, 0, 0, n_samples - n)))
        return torch.stack(outs)  # (S, B, heads)

    def _seed_cnn(
        self, network: NetworkName, s: int, images: Tensor, ranges: Tensor | None
    ) -> Tensor:
        """Return one seed's outputs (B, heads) for images (B, H, W, C) and ranges (B, beams)."""
        torso = "policy" if self.net.shared else network
        x = self._conv_torso(torso, s, images)
        if ranges is not None:
            y = 1 - ranges  # so that a beam that meets nothing is 0
            for layer in range(len(LIDAR_WIDTHS)):
                y = torch.relu(self._seed_dense(s, y, f"{torso}.lidar{layer}"))
            x = torch.cat([x, y], 1)
        x = torch.relu(self._seed_dense(s, x, f"{network}.dense"))
        return self._seed_dense(s, x, f"{network}.head")

    def _conv_torso(self, network: NetworkName, s: int, images: Tensor) -> Tensor:
        """Return one seed's features (B, n) of images (B, H, W, C)."""
        torso = self.net.conv_torso
        activation = torch.tanh if torso.tanh else torch.relu
        x = brightness(images, self.net.pool)
        for layer, (_, _, stride) in enumerate(torso.layers):
            name = f"{network}.conv{layer}"
            weight, bias = self._seed_weights[f"{name}.weight"], self._seed_weights[f"{name}.bias"]
            x = activation(F.conv2d(x, weight[s], bias[s], stride))
        x = x.flatten(1)
        if torso.dense:
            x = activation(self._seed_dense(s, x, f"{network}.embed"))
        return x

    def _seed_dense(self, s: int, x: Tensor, name: str) -> Tensor:
        weight, bias = self._seed_weights[f"{name}.weight"], self._seed_weights[f"{name}.bias"]
        return torch.addmm(bias[s], x, weight[s])


def brightness(images: Tensor, pool: int) -> Tensor:
    """Return images (B, H, W, C) uint8 as numbers in [0, 1], (B, C, H/pool, W/pool).

    Squares of pool × pool pixels are averaged; adding strided views is what torch does fastest.
    """
    x = images.permute(0, 3, 1, 2).to(torch.float32)
    height, width = (size // pool * pool for size in x.shape[2:])
    x = reduce(add, [x[..., i:height:pool, :] for i in range(pool)])
    x = reduce(add, [x[..., i:width:pool] for i in range(pool)])
    return x / (255 * pool * pool)
