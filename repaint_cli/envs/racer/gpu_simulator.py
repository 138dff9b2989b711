"""Our racing simulator with its cars on a GPU: for training."""

from typing import ClassVar, Self

from repaint_cli.envs.racer.device.card import check_card
from repaint_cli.envs.racer.simulator import RacerSimulator
from repaint_cli.errors import DeviceError


class GpuRacer(RacerSimulator):
    """The racer whose cars are on a GPU; `RacerSimulator.gpu_simulator` makes it, no card."""

    device: ClassVar[str] = "cuda"

    @classmethod
    def of(cls, env: RacerSimulator) -> Self | None:
        """Return a card's racer there; None where a setting is for the CPU, or no GPU works."""
        if len(env.tracks) > 1 or env.random_light or env.random_colours or env.training_noise:
            return None
        try:
            check_card()
        except DeviceError:
            return None
        return cls(**dict(env))
