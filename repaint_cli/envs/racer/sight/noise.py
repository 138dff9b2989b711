"""Small disturbances for robust evaluation: of a car's commands and of its images."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from repaint_cli.settings import EvalConfig


@dataclass(frozen=True)
class Noise:
    """Sizes of the disturbances; 0 is none."""

    action: float = 0.1
    """Steering and speed commands are each multiplied by 1 + U(−a, a)."""
    brightness: float = 0.1
    """An image is multiplied by 1 + U(−b, b)."""
    gaussian: float = 2.0
    """Standard deviation added to each pixel, grey levels."""
    salt_pepper: float = 0.001
    """Fraction of pixels that turn black or white."""
    shift: int = 1
    """An image moves by U{−s, …, s} pixels along each axis; its edge repeats."""

    @classmethod
    def of(cls, config: EvalConfig) -> Self:
        """Return the sizes that a card gives."""
        return cls(
            config.action_noise, config.brightness_noise, config.pixel_noise, config.salt_pepper,
            config.shift,
        )  # fmt: skip

    def __post_init__(self) -> None:
        for name in ("action", "brightness", "salt_pepper"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"noise {name} must be in [0, 1], found {getattr(self, name)}")
        for name in ("gaussian", "shift"):
            if not 0 <= getattr(self, name) < 100:
                raise ValueError(f"noise {name} must be in [0, 100), found {getattr(self, name)}")


def disturb_command(
    command: NDArray[np.float64], noise: Noise, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return a steering and speed command (2,) with its noise."""
    return command * (1 + rng.uniform(-noise.action, noise.action, size=2))


def disturb_image(
    image: NDArray[np.uint8], noise: Noise, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """Return a grey image (H, W) with its noise; always takes the same number of draws."""
    height, width = image.shape
    gain = np.float32(1 + rng.uniform(-noise.brightness, noise.brightness))
    down, right = rng.integers(-noise.shift, noise.shift, size=2, endpoint=True)
    rows = np.clip(np.arange(height) - down, 0, height - 1)
    columns = np.clip(np.arange(width) - right, 0, width - 1)
    grey = image[rows[:, None], columns] * gain  # (H, W) float32
    grey += np.float32(noise.gaussian) * rng.standard_normal(image.shape, dtype=np.float32)
    result: NDArray[np.uint8] = np.clip(np.rint(grey), 0, 255).astype(np.uint8)
    spots = round(noise.salt_pepper * image.size)
    where = rng.integers(image.size, size=spots)
    result.flat[where] = np.where(rng.integers(2, size=spots), 255, 0)
    return result
