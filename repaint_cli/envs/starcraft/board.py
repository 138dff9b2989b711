"""What stands beside the map in a film: the layers that the agent sees, a legend, counters."""

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from repaint_cli.envs.starcraft.rts.constants import SCREEN
from repaint_cli.envs.starcraft.shapes import LEGEND, draw_shape
from repaint_cli.report import style
from repaint_cli.report.video import font

COLUMNS, TIMES, GAP, LABEL = 4, 2, 12, 18
"""Layers in a row; how much larger they are shown; between two, and above each, pixels."""
TILE = SCREEN * TIMES
WIDTH = COLUMNS * TILE + (COLUMNS - 1) * GAP
HEIGHT = 3 * (TILE + LABEL)
"""Of all layers, pixels."""
GREY = "#555555"

Bytes = NDArray[np.uint8]


class Layers:
    """Draws the layers of the screen, and of the minimap."""

    def __init__(self, names: Sequence[str]) -> None:
        """Write the names of all layers, those of the minimap last."""
        self._still = Image.new("RGB", (WIDTH, HEIGHT), "white")
        brightened = np.sqrt(np.arange(256) / 255)  # most numbers are small
        colours = (style.ramp()(brightened)[:, :3] * 255).astype(np.uint8)  # (256, 3)
        self._palette = colours.ravel().tolist()
        self._places = [
            ((TILE + GAP) * (i % COLUMNS), (TILE + LABEL) * (i // COLUMNS))
            for i in range(len(names))
        ]
        pen = ImageDraw.Draw(self._still)
        for name, (x, y) in zip(names, self._places, strict=True):
            pen.text((x, y + LABEL / 2), name.replace("_", " "), GREY, font(12), anchor="lm")

    def draw(self, images: Sequence[Bytes]) -> Image.Image:
        """Return the picture of what is seen: screen and minimap, (84, 84, layers) each."""
        picture = self._still.copy()
        layers = [image[..., i] for image in images for i in range(image.shape[2])]
        for layer, (x, y) in zip(layers, self._places, strict=True):
            tile = Image.fromarray(np.ascontiguousarray(layer))
            tile.putpalette(self._palette)
            tile = tile.resize((TILE, TILE), Image.Resampling.NEAREST)
            picture.paste(tile.convert("RGB"), (x, y + LABEL))
        return picture


def legend(width: int, height: int, absent: Collection[str]) -> Image.Image:
    """Draw what the shapes on the map are, but for names that a game has none of."""
    picture = Image.new("RGB", (width * 2, height * 2), "white")
    pen, letters, x = ImageDraw.Draw(picture), font(24), 16.0
    for name, shape, colour in LEGEND:
        if name not in absent:
            draw_shape(pen, shape, (x + 10, height), 9, colour, 4 if shape in ("cross", "x") else 2)
            pen.text((x + 30, height), name, GREY, letters, anchor="lm")
            x += 30 + letters.getlength(name) + 26
    return picture.reduce(2)


def counters(numbers: Sequence[tuple[str, str]], width: int, height: int) -> Image.Image:
    """Draw numbers with their names above, each in a column of its own."""
    picture = Image.new("RGB", (width, height), "white")
    pen, column = ImageDraw.Draw(picture), width / len(numbers)
    for i, (name, number) in enumerate(numbers):
        x = (i + 0.5) * column
        pen.text((x, height * 0.3), name, GREY, font(13), anchor="mm")
        text = number.replace("-", "−")
        pen.text((x, height * 0.7), text, style.INK, _fit(text, column), anchor="mm")
    return picture


def _fit(text: str, width: float) -> ImageFont.FreeTypeFont:
    """Return the largest bold letters in which a text is not wider than its column."""
    size = 20
    while size > 9 and font(size, "-Bold").getlength(text) > width - 8:
        size -= 1
    return font(size, "-Bold")
