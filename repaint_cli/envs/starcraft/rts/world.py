"""What does not change in a game, as one record that kernels read: the map and its options."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.starcraft.rts.constants import (
    CENTRE_RADIUS,
    CLAWS,
    MAP_SIZE,
    MAX_PATCHES,
    PATCH_HALF_HEIGHT,
    PATCH_HALF_WIDTH,
    RANDOM_DELAY,
    REGENERATION,
    SCREEN,
    SCV,
)
from repaint_cli.envs.starcraft.rts.maps import MapSpec, Rectangle

WORLD = np.dtype(
    [
        ("loops", "i4"),  # of a game
        ("region", "f8", (4,)), ("base", "f8", (4,)),  # left, bottom, right, top
        ("has_base", "u1"), ("centre_x", "f8"), ("centre_y", "f8"),
        ("patches", "i4"), ("patch_x", "f8", (MAX_PATCHES,)), ("patch_y", "f8", (MAX_PATCHES,)),
        ("patch_dock_x", "f8", (MAX_PATCHES,)), ("patch_dock_y", "f8", (MAX_PATCHES,)),
        ("home_dock_x", "f8", (MAX_PATCHES,)), ("home_dock_y", "f8", (MAX_PATCHES,)),
        ("patch_way", "f8", (MAX_PATCHES,)),  # from a patch's dock to its dock at the centre
        ("minerals", "i4"), ("start_scvs", "i4"), ("marines", "i4"),
        ("left", "f8"), ("top", "f8"), ("pixel", "f8"),  # the screen's corner; a pixel's side
        ("fog", "u1"), ("zerglings", "i4"), ("respawn", "u1"), ("ends_without_marines", "u1"),
        ("mines_after_build", "u1"), ("award_on_order", "u1"), ("illegal_is_unavailable", "u1"),
        ("delay_low", "f8"), ("delay_high", "f8"),  # added to the period of a blow, loops
        ("damage_point", "f8"),  # of a zergling, loops
        ("regeneration", "f8"),  # of a zergling, hit points a loop
        ("cell_x", "i2", (SCREEN,)), ("cell_y", "i2", (SCREEN,)),  # of a pixel; −1: off the map
        ("open", "u1", (MAP_SIZE, MAP_SIZE)),  # cells whose middle is in the region, [y, x]
        ("cells", "i2", (4,)),  # of these: first column and row, end of columns and of rows
        ("ground", "u1", (SCREEN, SCREEN)),  # layer height_map
    ],
    align=True,
)  # fmt: skip
"""One map. Lengths are the game's units, times loops."""


def world_of(spec: MapSpec) -> NDArray[np.void]:
    """Return a map as kernels read it, (1,) of `WORLD`."""
    array = np.zeros(1, WORLD)
    world = array[0]
    world["loops"] = spec.loops
    world["region"] = spec.region
    world["marines"] = spec.marines
    _furnish(world, spec)
    world["left"] = spec.camera.x - spec.camera.width / 2
    world["top"] = spec.camera.y + spec.camera.width / 2
    world["pixel"] = spec.camera.width / SCREEN
    world["fog"], world["zerglings"] = spec.fog, spec.zerglings
    world["respawn"] = spec.respawn
    world["ends_without_marines"] = spec.ends_without_marines
    world["mines_after_build"] = spec.scv_after_build == "mine"
    world["award_on_order"] = spec.award_on == "order"
    world["illegal_is_unavailable"] = spec.illegal_site_is_unavailable
    world["delay_low"], world["delay_high"] = RANDOM_DELAY
    world["damage_point"], world["regeneration"] = CLAWS.damage_point, REGENERATION
    _lay_out(world, spec.region)
    return array


def _furnish(world: np.void, spec: MapSpec) -> None:
    """Put a base, its centre and its patches into a world.

    An SCV digs at a patch's dock and delivers at the dock at home, both on the line from the
    patch's middle to the centre's; its disc touches the patch's box and the centre's disc.
    """
    if spec.base is None:
        return
    world["has_base"], world["base"] = True, spec.base
    world["centre_x"], world["centre_y"] = spec.centre
    world["patches"] = len(spec.patches)
    world["minerals"], world["start_scvs"] = spec.minerals, spec.start_scvs
    for k, patch in enumerate(spec.patches):
        away = np.subtract(patch, spec.centre)
        far = float(np.sqrt(away @ away))
        with np.errstate(divide="ignore"):
            edge = far * np.min(np.array([PATCH_HALF_WIDTH, PATCH_HALF_HEIGHT]) / np.abs(away))
        near, home = far - edge - SCV.radius, CENTRE_RADIUS + SCV.radius
        world["patch_x"][k], world["patch_y"][k] = patch
        world["patch_dock_x"][k], world["patch_dock_y"][k] = spec.centre + away * (near / far)
        world["home_dock_x"][k], world["home_dock_y"][k] = spec.centre + away * (home / far)
        world["patch_way"][k] = near - home


def _lay_out(world: np.void, region: Rectangle) -> None:
    """Fill what belongs to each pixel of the screen, and to each cell of the map."""
    pixels = (np.arange(SCREEN) + 0.5) * world["pixel"]
    xs, ys = world["left"] + pixels, world["top"] - pixels
    for cells, places in ((world["cell_x"], xs), (world["cell_y"], ys)):
        inside = (places >= 0) & (places < MAP_SIZE)
        cells[:] = np.where(inside, np.floor(places), -1)
    middles = np.arange(MAP_SIZE) + 0.5
    world["open"][:] = _inside(middles, middles, region)
    rows, columns = np.nonzero(world["open"])
    world["cells"] = columns.min(), rows.min(), columns.max() + 1, rows.max() + 1
    world["ground"][:] = 127 * _inside(xs, ys, region)


def _inside(xs: NDArray[Any], ys: NDArray[Any], area: Rectangle) -> NDArray[np.bool_]:
    """Return which points (y, x) of a grid lie in a rectangle, (Y, X)."""
    across = (xs >= area.left) & (xs <= area.right)
    along = (ys >= area.bottom) & (ys <= area.top)
    return along[:, None] & across[None, :]
