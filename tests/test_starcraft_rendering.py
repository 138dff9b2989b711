"""Layers equal those of a slow painter, and six pictures that were looked at.

`python tests/test_starcraft_rendering.py` paints those anew, into tests/golden/; then look at them.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import starcraft_reference_layers as reference
from PIL import Image
from starcraft_bots import BuildingBot, pixel
from starcraft_reference_fights import FightingGame
from test_starcraft_combat import random_actions, with_marines

from repaint_cli.envs.starcraft.rts.constants import SELECT_POINT, SELF
from repaint_cli.envs.starcraft.rts.engine import MiniRTS
from repaint_cli.envs.starcraft.rts.maps import (
    BUILD_MARINES,
    BUILD_MARINES_FDZ,
    FIND_AND_DEFEAT_ZERGLINGS,
    MAPS,
)

FOLDER = Path(__file__).parent / "golden"


def built(spec, steps):
    """A base after some steps of a build order."""
    rts = MiniRTS(replace(spec, scv_after_build="mine"), 1)
    rts.reset(np.zeros(1, int))
    player = BuildingBot(rts, 0, 20, 7)
    for _ in range(steps):
        rts.step(np.array([player.action()]))
    return rts


def fought(spec, steps):
    """A map after marines ran about at random."""
    rts = with_marines(1, 20, spec)
    rng = np.random.default_rng(0)
    for _ in range(steps):
        rts.step(random_actions(rng, 1))
    return rts


def fresh(spec):
    rts = MiniRTS(spec, 1)
    rts.reset(np.zeros(1, int))
    return rts


STATES = {
    "starcraft-start": lambda: fresh(BUILD_MARINES),
    "starcraft-base": lambda: built(BUILD_MARINES, 260),
    "starcraft-many-marines": lambda: built(BUILD_MARINES, 900),
    "starcraft-fdz-start": lambda: fresh(BUILD_MARINES_FDZ),
    "starcraft-fdz-fights": lambda: fought(BUILD_MARINES_FDZ, 40),
    "starcraft-zerglings": lambda: fresh(FIND_AND_DEFEAT_ZERGLINGS),
}


def picture(rts):
    """All twelve layers in three rows of four, brightened to be told apart, (252, 336)."""
    seen = rts.observe()
    scales = (1, 127, 60, 36, 255, 1, 1, 60, 8, 127, 60, 255)
    layers = [*seen.screen[0], *seen.minimap[0]]
    shown = [
        np.minimum(layer.astype(int) * scale, 255)
        for layer, scale in zip(layers, scales, strict=True)
    ]
    return np.block([shown[k : k + 4] for k in (0, 4, 8)]).astype(np.uint8)


@pytest.mark.parametrize("name", STATES)
def test_a_picture_is_as_it_was(name):
    with Image.open(FOLDER / f"{name}.png") as golden:
        wanted = np.asarray(golden)
    np.testing.assert_array_equal(picture(STATES[name]()), wanted)


@pytest.mark.parametrize("name", ["starcraft-base", "starcraft-many-marines",
                                  "starcraft-fdz-fights", "starcraft-zerglings"])  # fmt: skip
def test_layers_equal_those_of_the_slow_painter(name):
    rts = STATES[name]()
    for _ in range(3):
        seen = rts.observe()
        game = FightingGame(rts.state.arrays[0], rts.world[0])
        np.testing.assert_array_equal(seen.screen[0], reference.screen(game))
        np.testing.assert_array_equal(seen.minimap[0], reference.minimap(game))
        rts.step(random_actions(np.random.default_rng(1), 1))


def test_density_is_as_many_pixels_as_the_units_cover():
    rts = built(BUILD_MARINES, 260)
    seen = rts.observe().screen[0]
    game = FightingGame(rts.state.arrays[0], rts.world[0])
    w, pixels = game.world, np.arange(84)
    covered = [
        reference.covers(figure, w["left"], w["top"], w["pixel"], pixels, pixels)[0].sum()
        for figure in reference.figures(game)
    ]
    assert seen[7].sum() == sum(covered)
    area = sum(  # 16 points a pixel, and pixels of (24 / 84)² square units
        np.pi * f[2] ** 2 if not f[3] else 4 * f[2] * f[3] for f in reference.figures(game)
    )
    inside = seen[8].sum() / 16 * (24 / 84) ** 2
    assert inside == pytest.approx(area - 3, rel=0.1)  # patches' ends are off the screen


def test_up_on_the_map_is_up_on_the_screen():
    rts = fresh(BUILD_MARINES)
    s = rts.state
    s.marine_hp[0, 0], s.marine_x[0, 0], s.marine_y[0, 0] = 45, 40.0, 34.0
    seen = rts.observe()
    rows, columns = np.nonzero(seen.screen[0, 3] == 5)
    assert rows.max() < 84 / 4
    assert columns.min() > 84 / 2
    selfs = np.argwhere(seen.minimap[0, 1] == SELF)
    assert [int((64 - 34) / 64 * 84), int(40 / 64 * 84)] in selfs.tolist()


@pytest.mark.parametrize("spec", MAPS.values(), ids=lambda spec: spec.name)
def test_a_pixel_and_its_place_are_each_others_image(spec):
    rts = fresh(spec)
    w = rts.world[0]
    for column, row in ((0, 0), (83, 0), (17, 42), (83, 83)):
        x = w["left"] + (column + 0.5) * w["pixel"]
        y = w["top"] - (row + 0.5) * w["pixel"]
        assert pixel(rts, x, y) == (column, row)


@pytest.mark.parametrize("spec", [BUILD_MARINES, BUILD_MARINES_FDZ], ids=lambda spec: spec.name)
def test_every_pixel_that_shows_an_own_unit_selects_it(spec):
    rts = built(spec, 230)
    shown = rts.observe().screen[0, 2]
    own, other = np.argwhere(shown == SELF), np.argwhere(shown != SELF)
    kept = rts.snapshot()
    rng = np.random.default_rng(0)
    for row, column in own[rng.choice(len(own), 60)]:
        rts.restore(kept)
        phi, _, _ = rts.step(np.array([(SELECT_POINT, column, row)]))
        assert phi[0, 3] == 1
    for row, column in other[::97]:
        rts.restore(kept)
        phi, _, _ = rts.step(np.array([(SELECT_POINT, column, row)]))
        assert phi[0, 2] == 1


if __name__ == "__main__":
    for name, state in STATES.items():
        Image.fromarray(picture(state())).save(FOLDER / f"{name}.png")
