"""What stands beside the map in a film: the layers that the agent sees, a legend, counters."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from repaint_cli.envs.starcraft.map_view import CLICK, COLOURS, REFUSED
from repaint_cli.envs.starcraft.rts.constants import SCREEN
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
        self._colours = (style.ramp()(np.arange(256))[:, :3] * 255).astype(np.uint8)  # (256, 3)
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
            tile = self._colours[layer].repeat(TIMES, 0).repeat(TIMES, 1)
            picture.paste(Image.fromarray(tile), (x, y + LABEL))
        return picture


def legend(width: int, height: int, with_zerglings: bool) -> Image.Image:
    """Draw what the shapes on the map are."""
    picture = Image.new("RGB", (width * 2, height * 2), "white")
    pen, letters = ImageDraw.Draw(picture), font(24)
    entries = [
        ("minerals", "box"), ("SCV", "square"), ("marine", "disc"), ("zergling", "triangle"),
        ("command", "cross"), ("refused", "x"),
    ]  # fmt: skip
    if not with_zerglings:
        entries = [entry for entry in entries if entry[0] != "zergling"]
    x, y = 16.0, float(height)
    for name, shape in entries:
        _sign(pen, shape, x + 12, y, COLOURS.get(name, CLICK if name == "command" else REFUSED))
        pen.text((x + 34, y), name, GREY, letters, anchor="lm")
        x += 34 + letters.getlength(name) + 32
    return picture.reduce(2)


def _sign(pen: ImageDraw.ImageDraw, shape: str, x: float, y: float, colour: str) -> None:
    """Draw a sign of the legend at twice its size."""
    r = 9.0
    if shape in ("box", "square"):
        tall = r / 2 if shape == "box" else r
        pen.rectangle([x - r, y - tall, x + r, y + tall], colour, style.INK)
    elif shape == "disc":
        pen.circle((x, y), r, colour, style.INK)
    elif shape == "triangle":
        pen.polygon([(x, y - r), (x + r, y + r), (x - r, y + r)], colour, style.INK)
    elif shape == "cross":
        pen.line([(x - r, y), (x + r, y)], colour, 4)
        pen.line([(x, y - r), (x, y + r)], colour, 4)
    else:
        pen.line([(x - r, y - r), (x + r, y + r)], colour, 4)
        pen.line([(x - r, y + r), (x + r, y - r)], colour, 4)


def counters(numbers: Sequence[tuple[str, str]], width: int, height: int) -> Image.Image:
    """Draw numbers with their names above, each in a column of its own."""
    picture = Image.new("RGB", (width, height), "white")
    pen, column = ImageDraw.Draw(picture), width / len(numbers)
    for i, (name, number) in enumerate(numbers):
        x = (i + 0.5) * column
        pen.text((x, height * 0.3), name, GREY, font(13), anchor="mm")
        pen.text(
            (x, height * 0.7),
            number.replace("-", "−"),
            style.INK,
            _fit(number, column),
            anchor="mm",
        )
    return picture


def _fit(text: str, width: float) -> "font.ImageFont":
    """Return the largest bold letters in which a text is not wider than its column."""
    size = 20
    while size > 9 and font(size, "-Bold").getlength(text) > width - 8:
        size -= 1
    return font(size, "-Bold")
