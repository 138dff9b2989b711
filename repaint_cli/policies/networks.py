"""Policy and critic networks whose parameters carry a seed axis.

S seeds train side by side and stay independent. All parameters lie in one buffer (S, P); each row
is [everything π uses | everything only V uses], and every layer's weight is a view into it, as is
its gradient into a second buffer. Freezing a seed's policy or critic is leaving its half row out of
the optimiser's step.
"""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from functools import cached_property
from math import inf, prod
from typing import Any, Literal

import numpy as np
import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.compound import Compound
from repaint_cli.policies.distributions import Categorical, Distribution, Gaussian
from repaint_cli.policies.image_network import Heads, ImageNetwork
from repaint_cli.policies.normalizer import Normalizer
from repaint_cli.policies.parameters import (
    AVAILABLE,
    NetworkName,
    first_values,
    leaves_of,
)
from repaint_cli.policies.precision import resolved
from repaint_cli.policies.spaces import Spaces, by_name

ACTIVATIONS = {"tanh": torch.tanh, "relu": torch.relu, "elu": F.elu}
"""Of dense layers, by name on a card."""

Counts = Sequence[int] | Tensor | None
"""How many of each seed's observations are real, (S,); all where absent."""

LINE = 16
"""Numbers of a line of memory: products may be summed in another order if they begin elsewhere."""

# The gradients are views into one buffer on purpose: one fill zeroes them, one row is a seed's.
warnings.filterwarnings("ignore", message="grad and param do not obey the gradient layout contract")


class ActorCritic:
    """S policies and S critics of one shape.

    They begin as `net.init` and `net.log_std_init` say. All their tensors lie on one device;
    observations may come from another.
    """

    def __init__(
        self, spaces: Spaces, net: NetConfig, n_seeds: int, device: str | torch.device = "cpu"
    ) -> None:
        self.spaces, self.net, self.n_seeds = spaces, resolved(net), n_seeds
        leaves = leaves_of(spaces, net)
        self.leaves = leaves["policy"] + leaves["value"]
        self.n_policy = sum(prod(leaf.shape) for leaf in leaves["policy"])
        total = sum(prod(leaf.shape) for leaf in self.leaves)
        width = -(-total // LINE) * LINE  # every seed's row begins where it would alone
        self.storage = torch.zeros(n_seeds, width, device=device)[:, :total]
        self.gradients = torch.zeros(n_seeds, width, device=device)[:, :total]
        self.device = self.storage.device
        self._uses = self._find_uses()
        self.weights = dict(self._views())
        clip = inf if net.obs_clip == "none" else net.obs_clip
        self.normalizer = (
            None if spaces.image
            else Normalizer(
                n_seeds, spaces.obs_shape[0], clip, net.obs_min_std, active=net.obs_normalize,
                device=device,
            )
        )  # fmt: skip
        self._frozen = self._detached()
        self._seeds = [self.alone(s) for s in range(n_seeds)] if n_seeds > 1 else []

    def alone(self, seed: int) -> "ActorCritic":
        """Return one seed's networks by themselves, S = 1, in the same memory."""
        one, row = copy(self), slice(seed, seed + 1)
        one.n_seeds, one._seeds = 1, []
        one.storage, one.gradients = self.storage[row], self.gradients[row]
        one.weights = dict(one._views())
        one._frozen = one._detached()
        one.normalizer = self.normalizer.alone(seed) if self.normalizer else None
        return one

    def to(self, device: str | torch.device) -> "ActorCritic":
        """Return these networks on a device: themselves where they lie there, else a copy."""
        if torch.empty(0, device=device).device == self.device:
            return self
        other = ActorCritic(self.spaces, self.net, self.n_seeds, device)
        other.storage.copy_(self.storage)
        if self.normalizer and other.normalizer:
            other.normalizer.load(self.normalizer.state())
        return other

    @cached_property
    def is_weight(self) -> Tensor:
        """Which numbers of a seed's row are weights, and not biases or log σ, (P,) bool."""
        kinds = [leaf.name.endswith(".weight") for leaf in self.leaves]
        sizes = torch.tensor([prod(leaf.shape) for leaf in self.leaves])
        return torch.tensor(kinds).repeat_interleave(sizes).to(self.device)

    def in_precision(self, precision: Literal["float32", "bf16", "auto"]) -> "ActorCritic":
        """Return these networks computing in another precision, in the same memory."""
        return self._with(precision=precision)

    def with_actions_of(self, net: NetConfig) -> "ActorCritic":
        """Return these networks with the actions that others leave out or count, in this memory."""
        return self._with(mask=net.mask, spatial=net.spatial)

    def _with(self, **settings: Any) -> "ActorCritic":
        other = copy(self)
        other.net = resolved(self.net.model_copy(update=settings))
        other._uses = other._find_uses()
        other._seeds = [one._with(**settings) for one in self._seeds]
        return other

    def _find_uses(self) -> Tensor:
        """Return which numbers of a compound action count with each command, (C, P − 1)."""
        uses = torch.tensor(self.spaces.uses, dtype=torch.float32, device=self.device)
        return torch.ones_like(uses) if self.net.spatial == "all" else uses

    def _views(self) -> Iterator[tuple[str, Tensor]]:
        start = 0
        for leaf in self.leaves:
            stop = start + prod(leaf.shape)
            shape = (self.n_seeds, *leaf.shape)
            weight = self.storage[:, start:stop].view(shape).detach().requires_grad_()
            weight.grad = self.gradients[:, start:stop].view(shape)
            yield leaf.name, weight
            start = stop

    def initialize(self, rngs: Sequence[np.random.Generator]) -> None:
        """Draw every seed's first parameters from its own generator."""
        for s, rng in enumerate(rngs):
            for name, drawn in first_values(self.leaves, self.net, rng):
                self.weights[name].data[s] = torch.from_numpy(drawn)
        if "policy.log_std" in self.weights:
            self.weights["policy.log_std"].data.fill_(self.net.log_std_init)

    def policy(self, obs: Any, counts: Counts = None) -> Distribution:
        """Return π(·|s) for raw observations (S, B, *O).

        Args:
            obs: observations, or several by name; each seed's first `counts[s]` are real, the rest
                is padding.
            counts: how many are real, (S,); all where absent. Padding of images is not computed.
        """
        return self._distribution(self._forward("policy", obs, counts), obs)

    def _distribution(self, out: Tensor, obs: Any) -> Distribution:
        """Return π(·|s) of the outputs of its head, (S, B, heads), for these observations."""
        if self.spaces.sizes:
            available = by_name(obs)[AVAILABLE].to(self.device) if self.net.mask else None
            return Compound.from_logits(out, self.spaces.sizes, self._uses, available)
        if self.spaces.discrete:
            return Categorical.from_logits(out)
        return Gaussian(out, self.weights["policy.log_std"].unsqueeze(1))

    def q_values(self, obs: Any, counts: Counts = None) -> Tensor:
        """Return Q(s, ·), (S, B, A): the logits of a policy over numbered actions."""
        return self._forward("policy", obs, counts)

    def value(self, obs: Any, counts: Counts = None) -> Tensor:
        """Return V(s), (S, B), for raw observations (S, B, *O); see `policy`."""
        return self._forward("value", obs, counts).squeeze(-1)

    def policy_and_value(self, obs: Any, counts: Counts = None) -> tuple[Distribution, Tensor]:
        """Return `policy` and `value`; layers that both use are computed once."""
        if not (self.net.shared and self.spaces.image):
            return self.policy(obs, counts), self.value(obs, counts)
        out = self._forward("both", obs, counts)
        return self._distribution(out[..., :-1], obs), out[..., -1]

    def _forward(self, network: Heads, obs: Any, counts: Counts) -> Tensor:
        """Return the outputs of the policy's or the critic's head, or of both, (S, B, heads).

        Seed by seed, so that its neighbours and the padding change no bit of a seed's; but where
        gradients are wanted of dense networks, in products of all seeds at once, which are faster.
        """
        parts = {name: part.to(self.device) for name, part in by_name(obs).items()}
        if self.normalizer is not None:
            parts = {name: self.normalizer.normalize(part) for name, part in parts.items()}
        one_by_one = self.spaces.image or not torch.is_grad_enabled()
        if not (one_by_one and self._seeds):
            return self._outputs(network, parts)
        width, outs = next(iter(parts.values())).shape[1], []
        real = counts.tolist() if isinstance(counts, Tensor) else counts
        for s, one in enumerate(self._seeds):
            n = width if real is None else real[s]
            out = one._outputs(network, {name: x[s : s + 1, :n] for name, x in parts.items()})
            outs.append(out if n == width else F.pad(out, (0, 0, 0, width - n)))
        return torch.cat(outs)

    def _outputs(self, network: Heads, parts: Mapping[str, Tensor]) -> Tensor:
        """Return outputs (S, B, heads); of images S is 1, as grouped convolutions are slower."""
        if self.spaces.image:
            layers = ImageNetwork(self.weights, self.net, self.spaces)
            return layers.outputs(network, {n: x.squeeze(0) for n, x in parts.items()}).unsqueeze(0)
        assert network != "both"
        x, activation = parts[""], ACTIVATIONS[self.net.activation]
        learning = torch.is_grad_enabled()
        *hidden, head = self._dense_layers(network) if learning else self._frozen[network]
        for weight, bias in hidden:
            x = activation(torch.baddbmm(bias, x, weight))
        return torch.baddbmm(head[1], x, head[0])

    def _dense_layers(self, network: NetworkName) -> list[tuple[Tensor, Tensor]]:
        """Return the weights (S, in, out) and biases (S, 1, out) of a dense network."""
        names = [f"{network}.{i}" for i in (*range(len(self.net.widths(network))), "head")]
        return [
            (self.weights[f"{n}.weight"], self.weights[f"{n}.bias"].unsqueeze(1)) for n in names
        ]

    def _detached(self) -> dict[NetworkName, list[tuple[Tensor, Tensor]]]:
        """Return the layers of dense networks without gradients: acting is many small calls."""
        names: tuple[NetworkName, ...] = () if self.spaces.image else ("policy", "value")
        with torch.no_grad():
            return {
                name: [(weight.detach(), bias) for weight, bias in self._dense_layers(name)]
                for name in names
            }
