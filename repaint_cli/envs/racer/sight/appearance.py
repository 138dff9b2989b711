"""How a track looks in an episode of training: light and grey levels drawn anew for each."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.sight.camera import SKY
from repaint_cli.envs.racer.sight.ground import CENTRE_LINE, FIELD, LINE, ROAD

KNOTS = np.array([0.0, ROAD, FIELD, CENTRE_LINE, SKY, LINE, 255.0])
"""Grey levels that are moved; what lies between two of them moves along."""


@dataclass(frozen=True)
class RandomAppearance:
    """How much light and grey levels of an episode may differ from the usual ones; 0 is not."""

    light: float = 0.0
    """All grey levels are multiplied by 1 + U(−l, l)."""
    colours: float = 0.0
    """Each of `KNOTS` moves by U(−c, c) of the whole scale first."""

    def table(self, rng: np.random.Generator) -> NDArray[np.uint8]:
        """Return what each grey level becomes in an episode, (256,)."""
        moved = KNOTS + 255 * rng.uniform(-self.colours, self.colours, len(KNOTS))
        light = 1 + rng.uniform(-self.light, self.light)
        levels = np.interp(np.arange(256), KNOTS, np.clip(moved, 0, 255)) * light
        return np.clip(np.rint(levels), 0, 255).astype(np.uint8)
