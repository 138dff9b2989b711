"""A policy in the mirror of a symmetry g, π_g(a|s) = π(g·a | g·s), and the mean of both.

The image of a network is a network: its weights, reordered and with other signs. Only images are
flipped as they are read (`net.flip_images`), since convolutions leave out the last columns.
**S** seeds, **O** observation, **A** actions.
"""

from typing import Any, Literal

import torch
from torch import Tensor

from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.distributions import Distribution, mixture
from repaint_cli.policies.networks import ActorCritic, Counts
from repaint_cli.policies.spaces import Spaces
from repaint_cli.symmetry import SignedPermutation, Symmetry


def mirrored(network: ActorCritic, symmetry: Symmetry) -> ActorCritic:
    """Return the policies π(g·a | g·s) and the critics V(g·s) of a network, in memory of its own.

    A critic's values are those of the rewards that it learned, paid in the mirror.
    """
    net = network.net
    if symmetry.channels is not None:
        net = net.model_copy(update={"flip_images": not net.flip_images})
    image = ActorCritic(network.spaces, net, network.n_seeds, network.device)
    for name, weight in network.weights.items():
        image.weights[name].data.copy_(_mapped(name, weight.detach(), net, symmetry))
    if network.normalizer and image.normalizer and symmetry.vector:
        own, order = network.normalizer, list(symmetry.vector.order)
        mean, var = symmetry.vector(own.mean), own.var[:, order]
        image.normalizer.load({"mean": mean, "var": var, "count": own.count})
    return image


def _mapped(name: str, weight: Tensor, net: NetConfig, symmetry: Symmetry) -> Tensor:
    """Return a parameter (S, …) of the image."""
    network, layer, *kind = name.split(".")
    first = layer == ("0" if net.widths("value" if network == "value" else "policy") else "head")
    if kind == ["weight"]:
        if layer == "conv0" and symmetry.channels is not None:
            weight = weight[:, :, list(symmetry.channels)]
        elif layer == "lidar0" and symmetry.beams is not None:
            weight = weight[:, list(symmetry.beams)]
        elif first and net.kind == "mlp" and symmetry.vector:
            weight = _inputs(weight, symmetry.vector)
    if network != "policy":
        return weight
    if layer == "head":
        weight = symmetry.actions(weight)
    elif layer == "log_std":
        weight = weight[:, list(symmetry.actions.order)]
    return weight


def _inputs(weight: Tensor, of: SignedPermutation) -> Tensor:
    """Return a weight (S, O, n) for reordered inputs; a reflection is its own inverse."""
    mapped: Tensor = of(weight.transpose(1, 2))
    return mapped.transpose(1, 2)


class BothViews:
    """A network and its image as one policy: the mean of their probabilities.

    A Gaussian has the mean and the variance of the mixture.
    """

    def __init__(self, network: ActorCritic, image: ActorCritic) -> None:
        self.views = (network, image)

    @property
    def spaces(self) -> Spaces:
        """What it reads and writes."""
        return self.views[0].spaces

    @property
    def net(self) -> NetConfig:
        """The layers of each."""
        return self.views[0].net

    def to(self, device: str | torch.device) -> "BothViews":
        """Return both on a device; see `ActorCritic.to`."""
        return BothViews(*(view.to(device) for view in self.views))

    def policy(self, obs: Any, counts: Counts = None) -> Distribution:
        """Return its distribution at observations (S, B, *O); see `ActorCritic.policy`."""
        parts = [view.policy(obs, counts) for view in self.views]
        weights = torch.ones(len(parts), self.views[0].n_seeds, device=self.views[0].device)
        return mixture(parts, weights)

    def in_precision(self, precision: Literal["float32", "bf16", "auto"]) -> "BothViews":
        """Return both computing in another precision; see `ActorCritic.in_precision`."""
        return BothViews(*(view.in_precision(precision) for view in self.views))


PolicyNetwork = ActorCritic | BothViews
"""What acts: a network, or the mean of two views of one."""
