"""The game's layers as images that a network reads without knowing the game.

A network divides an image's numbers by 255. So each layer is spread over 0 to 255 here: a layer of
few values, such as what kind of unit is seen, by a whole factor, so that no two values become one.

**K** environments · **L** layers of an image · **H**, **W** its height and width, pixels.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from repaint_cli.kernels import kernel

Bytes = NDArray[np.uint8]


class Layer(NamedTuple):
    """A layer of an image."""

    name: str
    """As PySC2 has it."""
    source: int
    """Which of the engine's layers it is made of."""
    values: tuple[int, ...]
    """What its first values become; larger ones become the last of these."""


def _times(factor: int, largest: int) -> tuple[int, ...]:
    return tuple(factor * value for value in range(largest + 1))


AS_IT_IS = _times(1, 255)
EMPTY = (0,)
"""Of what these tasks have none of: creep, energy fields."""

HEIGHT = Layer("height_map", 0, AS_IT_IS)
VISIBILITY = Layer("visibility_map", 1, _times(127, 2))
RELATIVE = Layer("player_relative", 2, _times(63, 4))
UNIT_TYPE = Layer("unit_type", 3, _times(36, 7))
SELECTED = Layer("selected", 4, _times(255, 1))
HIT_POINTS = Layer("unit_hit_points", 5, AS_IT_IS)

SCREEN_LAYERS = {
    "terran": (
        HEIGHT, VISIBILITY, RELATIVE, UNIT_TYPE, SELECTED, HIT_POINTS,
        Layer("unit_hit_points_ratio", 6, AS_IT_IS),
        Layer("unit_density", 7, _times(17, 15)),
        Layer("unit_density_aa", 8, AS_IT_IS),
    ),
    "coach-prefix": (
        HEIGHT, VISIBILITY, Layer("creep", 0, EMPTY), Layer("power", 0, EMPTY),
        Layer("player_id", 2, (0, 15, 0, 240, 30)),  # mine is 1, neutral 16, the enemy's 2
        RELATIVE, UNIT_TYPE, SELECTED, HIT_POINTS,
    ),
}  # fmt: skip
"""The nine layers of the screen, by the setting `layers`."""

MINIMAP_LAYERS = {
    "terran": (
        VISIBILITY._replace(source=0), RELATIVE._replace(source=1), SELECTED._replace(source=2),
    ),
    "coach-prefix": (
        Layer("height_map", 0, EMPTY),  # the maps are flat
        VISIBILITY._replace(source=0),
        Layer("creep", 0, EMPTY),
    ),
}  # fmt: skip
"""The three layers of the minimap, by the setting `layers`."""


class Spread:
    """Turns the engine's layers into images."""

    def __init__(self, layers: tuple[Layer, ...]) -> None:
        self.names = tuple(layer.name for layer in layers)
        self._sources = np.array([layer.source for layer in layers])  # (L,)
        self._tables = np.array(  # (L, 256)
            [np.pad(layer.values, (0, 256 - len(layer.values)), "edge") for layer in layers],
            np.uint8,
        )

    def __call__(self, layers: Bytes) -> Bytes:
        """Return images (K, H, W, L), a new array, of the engine's layers (K, ?, H, W)."""
        n, _, height, width = layers.shape
        images = np.empty((n, height, width, len(self.names)), np.uint8)
        _spread(layers, self._sources, self._tables, images)
        return images


@kernel
def _spread(layers: Bytes, sources: NDArray[np.int64], tables: Bytes, images: Bytes) -> None:
    """Look every value up in its layer's table (L, 256)."""
    n_images, height, width, n_layers = images.shape
    for k in range(n_images):
        for y in range(height):
            for x in range(width):
                for i in range(n_layers):
                    images[k, y, x, i] = tables[i, layers[k, sources[i], y, x]]
