"""The layers of a policy and a critic that read images, of one seed."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.images import brightness
from repaint_cli.policies.parameters import LIDAR_WIDTHS, images_of, vectors_of
from repaint_cli.policies.spaces import Spaces

Heads = Literal["policy", "value", "both"]
"""Whose outputs are computed: the policy's, the critic's, or both in one pass."""


@dataclass(frozen=True)
class ImageNetwork:
    """Convolutions, the layers beside them for ranges and vectors, a dense layer, and the heads."""

    weights: Mapping[str, Tensor]
    """Parameters by name, (1, …)."""
    net: NetConfig
    spaces: Spaces

    def outputs(self, network: Heads, parts: Mapping[str, Tensor]) -> Tensor:
        """Return outputs (B, heads) for images (B, H, W, C) and vectors (B, n), by name.

        Those of "both" stand side by side; both read the policy's features.
        """
        torso = "policy" if self.net.shared else network
        x = self._features_of_parts(torso, parts) if self.spaces.parts else (
            self._features(torso, *parts.values())
        )  # fmt: skip
        heads = ("policy", "value") if network == "both" else (network,)
        dense = ("policy",) if self.net.shared == "all" else heads
        hidden = [torch.relu(self._dense(x, f"{name}.dense", self._dtype)) for name in dense]
        of_heads = hidden * (len(heads) // len(dense))
        outs = [self._dense(y, f"{h}.head") for h, y in zip(heads, of_heads, strict=True)]
        return torch.cat(outs, 1)

    @property
    def _dtype(self) -> torch.dtype:
        """Of convolutions and of the large dense layers, which are most of the arithmetic."""
        return torch.bfloat16 if self.net.precision == "bf16" else torch.float32

    def _features(self, torso: str, images: Tensor, ranges: Tensor | None = None) -> Tensor:
        """Return features (B, n) of images (B, H, W, C) and ranges (B, beams)."""
        x = self._conv_torso(torso, images)
        if ranges is None:
            return x
        y = 1 - ranges  # so that a beam that meets nothing is 0
        for layer in range(len(LIDAR_WIDTHS)):
            y = torch.relu(self._dense(y, f"{torso}.lidar{layer}"))
        return torch.cat([x, y], 1)

    def _features_of_parts(self, torso: str, parts: Mapping[str, Tensor]) -> Tensor:
        """Return features (B, n) of several images (B, H, W, C) and vectors (B, n)."""
        features = [self._conv_torso(f"{torso}.{n}", parts[n]) for n in images_of(self.spaces)]
        if names := vectors_of(self.spaces):
            vector = torch.cat([parts[name].float() for name in names], 1)
            features.append(torch.tanh(self._dense(vector, f"{torso}.vector")))
        return torch.cat(features, 1)

    def _conv_torso(self, network: str, images: Tensor) -> Tensor:
        """Return features (B, n) of images (B, H, W, C)."""
        torso = self.net.conv_torso
        activation = torch.tanh if torso.tanh else torch.relu
        x = brightness(images.flip(2) if self.net.flip_images else images, self.net.pool)
        for layer, (_, _, stride) in enumerate(torso.layers):
            weight, bias = self._layer(f"{network}.conv{layer}", x.dtype)
            convolve = convolve_patches if x.is_cuda and not layer else F.conv2d
            x = activation(convolve(x, weight, bias, stride).to(self._dtype))
        x = x.flatten(1)
        if torso.dense:
            x = activation(self._dense(x, f"{network}.embed", self._dtype))
        return x

    def _dense(self, x: Tensor, name: str, dtype: torch.dtype = torch.float32) -> Tensor:
        weight, bias = self._layer(name, dtype)
        return torch.addmm(bias, x.to(dtype), weight)

    def _layer(self, name: str, dtype: torch.dtype) -> tuple[Tensor, Tensor]:
        """Return the weight and the bias of a layer, as they enter a product."""
        weight, bias = (self.weights[f"{name}.{part}"].squeeze(0) for part in ("weight", "bias"))
        return weight.to(dtype), bias.to(dtype)


def convolve_patches(x: Tensor, weight: Tensor, bias: Tensor, stride: int) -> Tensor:
    """Return the convolution of images (B, C, H, W) as one product of all their patches.

    On a GPU, where the gradient of a first convolution's weights, of few channels, takes five times
    as long in kernels that add in the same order each time. Its input needs no gradient.
    """
    (n, _, height, width), size = x.shape, weight.shape[-1]
    rows, columns = (1 + (side - size) // stride for side in (height, width))
    patches = x.unfold(2, size, stride).unfold(3, size, stride)  # (B, C, rows, columns, k, k)
    flat = patches.permute(0, 2, 3, 1, 4, 5).reshape(n * rows * columns, weight[0].numel())
    out = torch.addmm(bias, flat, weight.flatten(1).T)
    return out.view(n, rows, columns, len(weight)).permute(0, 3, 1, 2)
