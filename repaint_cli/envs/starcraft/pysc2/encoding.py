"""The game's feature layers, encoded as our simulator's; see `engine.Observation`."""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.starcraft.rts.constants import SCREEN, UNIT_TYPES
from repaint_cli.envs.starcraft.rts.maps import Rectangle

Bytes = NDArray[np.uint8]

PLAYABLE_HEIGHT = 127
"""What the layer of heights says where units can be; elsewhere 0. The maps are flat."""

MOST_HIT_POINTS = 1600
MOST_DENSITY = 15

VISIBILITY = np.array([0, 1, 2, 0], np.uint8)
"""Hidden, seen before, visible; the game's fourth value is hidden too."""


PLAYER = ("minerals", "food_used", "food_cap", "food_workers", "army_count")
"""What PySC2 calls the measurements."""


def screen(observation: Any, playable: NDArray[np.bool_]) -> Bytes:
    """Return the nine layers of the screen, (9, 84, 84).

    Args:
        observation: PySC2's.
        playable: the pixels where units can be, (84, 84).
    """
    layers = observation["feature_screen"]
    return np.stack(
        [
            np.where(playable, PLAYABLE_HEIGHT, 0).astype(np.uint8),
            _look_up(VISIBILITY, layers.visibility_map),
            _bytes(layers.player_relative, 4),
            _look_up(unit_types(), layers.unit_type),
            _bytes(layers.selected, 1),
            _look_up(_hit_points(), layers.unit_hit_points),
            _bytes(layers.unit_hit_points_ratio, 255),
            _bytes(layers.unit_density, MOST_DENSITY),
            _bytes(layers.unit_density_aa, 255),
        ]
    )


def minimap(observation: Any) -> Bytes:
    """Return the three layers of the minimap, (3, 84, 84)."""
    layers = observation["feature_minimap"]
    return np.stack(
        [
            _look_up(VISIBILITY, layers.visibility_map),
            _bytes(layers.player_relative, 4),
            _bytes(layers.selected, 1),
        ]
    )


def measurements(observation: Any) -> NDArray[np.int32]:
    """Return minerals, supply and units, (5,)."""
    player = observation["player"]
    return np.array([getattr(player, name) for name in PLAYER], np.int32)


def playable_pixels(region: Rectangle, camera: Any, width: float) -> NDArray[np.bool_]:
    """Return which pixels of the screen show what can be played on, (84, 84).

    Args:
        region: that can be played on, units.
        camera: the point in the middle of the screen, units.
        width: of the screen, units.
    """
    offsets = ((np.arange(SCREEN) + 0.5) / SCREEN - 0.5) * width
    x, y = camera.x + offsets, camera.y - offsets
    columns = (region.left <= x) & (x < region.right)
    rows = (region.bottom <= y) & (y < region.top)
    return np.asarray(rows[:, None] & columns, np.bool_)


@lru_cache
def unit_types() -> Bytes:
    """Return what the layer `unit_type` says of each of the game's types; the last is of others."""
    from pysc2.lib import units

    kinds = {
        "command centre": ("CommandCenter", "CommandCenterFlying"),
        "supply depot": ("SupplyDepot", "SupplyDepotLowered"),
        "barracks": ("Barracks", "BarracksFlying"),
        "SCV": ("SCV",),
        "marine": ("Marine",),
    }
    types = {units.Terran[name]: kind for kind, names in kinds.items() for name in names}
    types[units.Zerg.Zergling] = "zergling"
    types |= {unit: "minerals" for unit in units.Neutral if "MineralField" in unit.name}
    table = np.zeros(max(types) + 2, np.uint8)
    for unit, kind in types.items():
        table[unit] = UNIT_TYPES.index(kind)
    return table


@lru_cache
def _hit_points() -> Bytes:
    points = np.arange(MOST_HIT_POINTS + 1)
    return np.asarray(np.round(255 * np.log1p(points) / np.log1p(MOST_HIT_POINTS)), np.uint8)


def _look_up(table: Bytes, layer: NDArray[np.int32]) -> Bytes:
    encoded: Bytes = np.take(table, np.asarray(layer), mode="clip")
    return encoded


def _bytes(layer: NDArray[np.int32], largest: int) -> Bytes:
    return np.clip(np.asarray(layer), 0, largest).astype(np.uint8)
