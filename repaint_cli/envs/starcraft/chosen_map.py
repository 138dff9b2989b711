"""The map that a card's settings choose: what it is like, and what the screen shows of it."""

from dataclasses import replace
from typing import TYPE_CHECKING

from repaint_cli.envs.starcraft.rts.maps import BUILD_MARINES_FDZ, MAPS, Camera, MapSpec, Rectangle

if TYPE_CHECKING:
    from repaint_cli.envs.starcraft.simulator import StarCraftSimulator

MIDDLE, MARGIN = 32.0, 1.0
"""Of the map whose size a card may choose; and how much further its camera sees on each side."""


def own_camera(settings: "StarCraftSimulator") -> Camera:
    """Return what the screen shows where the setting `camera` is `map`."""
    if settings.map_size is None:
        return MAPS[settings.map].camera
    return Camera(MIDDLE, MIDDLE, settings.map_size + 2 * MARGIN)


def chosen_map(settings: "StarCraftSimulator") -> MapSpec:
    """Return the map and its rules."""
    own = replace(MAPS[settings.map], camera=own_camera(settings))
    if settings.map_size is not None:
        low, high = MIDDLE - settings.map_size / 2, MIDDLE + settings.map_size / 2
        own = replace(own, region=Rectangle(low, low, high, high))
    if settings.camera == "large":
        own = replace(own, camera=BUILD_MARINES_FDZ.camera)
    return replace(
        own,
        minutes=own.minutes if settings.minutes is None else settings.minutes,
        zerglings=own.zerglings if settings.zerglings is None else settings.zerglings,
        respawn=settings.respawn,
        minerals=settings.minerals,
        start_scvs=settings.scvs,
        scv_after_build=settings.scv_after_build,
        award_on=settings.award_on,
        illegal_site_is_unavailable=settings.illegal_site == "unavailable",
    )
