"""Our racing simulator with its cars on a GPU: for training."""

from typing import ClassVar, Self

from repaint_cli.envs.racer.simulator import RacerSimulator


class GpuRacer(RacerSimulator):
    """The racer whose cars are on a GPU; `RacerSimulator.gpu_simulator` makes it, no card."""

    device: ClassVar[str] = "cuda"

    @classmethod
    def of(cls, env: RacerSimulator) -> Self | None:
        """Return a card's racer there, or None where a setting is for the CPU alone."""
        of_cpu = len(env.tracks) > 1, env.random_light, env.random_colours, env.training_noise
        return None if any(of_cpu) else cls(**dict(env))
