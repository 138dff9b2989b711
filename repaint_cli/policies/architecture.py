"""Which layers a policy and a critic have: the [net] section of a card."""

from dataclasses import dataclass
from typing import Literal

from pydantic import Field, PositiveFloat, PositiveInt, ValidationInfo, field_validator

from repaint_cli.settings import Settings

Convolution = tuple[PositiveInt, PositiveInt, PositiveInt]
"""Filters, kernel, stride."""


@dataclass(frozen=True)
class ConvTorso:
    """The convolutions between an image and the dense layers."""

    layers: tuple[Convolution, ...]
    """(filters, kernel, stride) of each."""
    tanh: bool = False
    """Whether tanh follows each layer instead of ReLU."""
    dense: int | None = None
    """Width of a dense layer behind them, if any."""


CONV_TORSOS = {
    "3-layer": ConvTorso(((32, 8, 4), (64, 4, 2), (64, 3, 1))),
    "4-layer": ConvTorso(((32, 5, 2), (32, 3, 1), (64, 3, 2), (64, 3, 1)), tanh=True, dense=64),
    "5-layer": ConvTorso(((32, 3, 1), (64, 3, 2), (64, 3, 1), (128, 3, 2), (128, 3, 1))),
}
"""DeepRacer's three camera networks, which the paper names by their number of layers."""


class NetConfig(Settings):
    """The policy's and the critic's networks."""

    kind: Literal["mlp", "cnn"] = "mlp"
    """Dense layers on a vector, or convolutions on an image."""
    hidden: tuple[PositiveInt, ...] = (64, 64)
    """Widths of the dense layers of an `mlp`."""
    value_hidden: tuple[PositiveInt, ...] | None = None
    """Those of its critic, where they are others."""
    activation: Literal["tanh", "relu", "elu"] = "tanh"
    """What follows the dense layers of an `mlp`."""
    init: Literal["orthogonal", "uniform"] = "orthogonal"
    """First weights: orthogonal (gain √2, the heads 0.01 and 1) with biases of 0, or uniform on
    ±1/√(inputs of the layer), biases too, which is PyTorch's default."""
    log_std_init: float = 0.0
    """log σ that a policy begins with; continuous actions."""
    obs_normalize: bool = True
    """Whether vectors are normalised by their running mean and deviation; false leaves them as they
    are, as those beside images always are, and then neither `obs_clip` nor `obs_min_std` counts."""
    obs_clip: PositiveFloat | Literal["none"] = 5.0
    """Normalised vectors are clipped to ± this."""
    obs_min_std: float = Field(0.1, ge=0)
    """The least standard deviation that vectors are divided by."""
    conv: Literal["3-layer", "4-layer", "5-layer"] | tuple[Convolution, ...] = "3-layer"
    """One of the paper's by name, or (filters, kernel, stride) of each ReLU convolution."""
    dense: int = Field(512, gt=0)
    """Width of the ReLU layer between the convolutions and the head."""
    vector: int = Field(64, gt=0)
    """Width of the tanh layer that reads the vectors beside several images."""
    spatial: Literal["used", "all"] = "used"
    """Which numbers of a compound action count in probabilities and entropies: those that its
    command uses, such as the point of a command that needs one, or all (as RL Coach has it)."""
    mask: bool = False
    """Whether commands that are not available are left out of the policy (SC2LE), or are only seen
    in the observations."""
    pool: int = Field(2, ge=1)
    """Side of the squares of pixels averaged before the convolutions; 1 is the paper's size."""
    flip_images: bool = False
    """Whether images are flipped left and right before they are read: a student that began as a
    teacher's mirror image sees the world so."""
    shared: bool | Literal["all"] = False
    """Whether policy and critic share the layers that read images and vectors (true), all layers
    but their heads ("all"), or none (false)."""
    precision: Literal["float32", "bf16", "auto"] = "float32"
    """What a `cnn` computes in: float32, bfloat16 (bf16: all convolutions but the first, and the
    first dense layer; weights and sums stay float32), or auto: bf16 where the CPU has instructions
    for it. A run keeps what it began with."""

    @field_validator("flip_images")
    @classmethod
    def _reads_images(cls, flips: bool, info: ValidationInfo) -> bool:
        if flips and info.data.get("kind") == "mlp":
            raise ValueError("expected false where net.kind is mlp")
        return flips

    @field_validator("precision")
    @classmethod
    def _of_images(cls, precision: str, info: ValidationInfo) -> str:
        if precision == "bf16" and info.data.get("kind") == "mlp":
            raise ValueError("expected float32 or auto where net.kind is mlp")
        return precision

    def widths(self, network: Literal["policy", "value"]) -> tuple[int, ...]:
        """Return the widths of the dense layers of an `mlp`'s policy or critic."""
        if network == "policy" or self.value_hidden is None:
            return self.hidden
        return self.value_hidden

    def alike(self, other: "NetConfig") -> bool:
        """Return whether a policy of one can begin with the weights of the other."""
        return self._shapes == other._shapes and self.other_scaling(other) is None

    def other_scaling(self, other: "NetConfig") -> str | None:
        """Return a setting that differs and that the shapes of weights do not show, or None."""
        if self.kind == "cnn":
            return None if self.pool == other.pool else "pool"
        scaling = ("obs_clip", "obs_min_std") if self.obs_normalize else ()
        names = ("activation", "obs_normalize", *scaling)
        return next((n for n in names if getattr(self, n) != getattr(other, n)), None)

    @property
    def _shapes(self) -> tuple[object, ...]:
        """What the shapes of a network's weights follow from, beside its spaces."""
        if self.kind == "cnn":
            return self.kind, self.conv_torso, self.dense, self.shared, self.vector
        return self.kind, self.widths("policy"), self.widths("value")

    @property
    def conv_torso(self) -> ConvTorso:
        """The convolutions of a `cnn`."""
        return CONV_TORSOS[self.conv] if isinstance(self.conv, str) else ConvTorso(self.conv)
