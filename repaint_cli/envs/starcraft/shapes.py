"""The shapes of units and commands in films: on the map, and in its legend."""

from PIL import ImageDraw

from repaint_cli.report.style import INK, METHOD_COLOURS

Pen = ImageDraw.ImageDraw
Point = tuple[float, float]

MINERALS, STRUCTURE, CLICK, REFUSED = METHOD_COLOURS["repaint-joint"], "#c9c4b8", INK, "#7A5195"
SCV, MARINE, ZERGLING = METHOD_COLOURS["warm-start"], METHOD_COLOURS["repaint"], "#D55E00"
FRAME = "#9a9a9a"
"""Colours of Okabe and Ito's palette; shapes tell units apart, too."""

LEGEND = (
    ("minerals", "box", MINERALS), ("SCV", "square", SCV), ("marine", "disc", MARINE),
    ("zergling", "triangle", ZERGLING), ("unseen", "outline", ZERGLING),
    ("command's point", "cross", CLICK), ("refused", "x", REFUSED), ("screen", "frame", FRAME),
)  # fmt: skip
"""What is drawn: its name, its shape and its colour."""


def draw_shape(pen: Pen, shape: str, point: Point, size: float, colour: str, line: int) -> None:
    """Draw a shape around a point.

    Args:
        pen: of the picture.
        shape: one of `LEGEND`.
        point: its middle, pixels.
        size: half its width, pixels.
        colour: that fills it.
        line: width of its border, or of its lines, pixels.
    """
    x, y = point
    if shape in ("box", "square"):
        tall = size / 2 if shape == "box" else size
        pen.rectangle([x - size, y - tall, x + size, y + tall], colour, INK, line)
    elif shape == "frame":
        pen.rectangle([x - size, y - size, x + size, y + size], None, colour, line)
    elif shape == "disc":
        pen.circle(point, size, colour, INK, line)
    elif shape in ("triangle", "outline"):
        wide, low = 1.1 * size, y + 0.8 * size
        corners = [(x, y - 1.2 * size), (x + wide, low), (x - wide, low)]
        unseen = shape == "outline"
        pen.polygon(corners, None if unseen else colour, colour if unseen else INK, line)
    else:
        turned = (1, 1) if shape == "x" else (1, 0)
        for across, down in (turned, (turned[1], -turned[0])):
            ends = [(x - size * across, y - size * down), (x + size * across, y + size * down)]
            pen.line(ends, colour, line)
