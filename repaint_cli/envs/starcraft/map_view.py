"""The map from above, for films: ground, fog, minerals, structures, units, selection, command.

Lengths are the game's units, of which y points up; in pictures it points down.
"""

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from repaint_cli.envs.starcraft import shapes
from repaint_cli.envs.starcraft.names import WITH_A_POINT
from repaint_cli.envs.starcraft.rts import constants as game
from repaint_cli.envs.starcraft.rts import state as states
from repaint_cli.envs.starcraft.rts.maps import MapSpec, Rectangle
from repaint_cli.report import style
from repaint_cli.report.video import font

WIDTH, HEIGHT = 640, 544
"""Of the picture, pixels."""
FINE = 2
"""It is drawn this many times finer and averaged, so that edges are smooth."""
MARGIN = 1.0
"""Around what can be played on, units."""

GROUND, OUTSIDE = "#e9e6dd", "#ffffff"
SHADES = np.array([(58, 62, 70), (168, 168, 164), (233, 230, 221)], np.uint8)
"""Of cells that are hidden, that were seen, and that are visible."""
BASE_LINE = "#a8a294"
LEAST_RADIUS = 3.2
"""Of a unit, so that it can be seen, pixels."""
Pen = ImageDraw.ImageDraw


class MapView:
    """Draws one game of a map."""

    def __init__(self, spec: MapSpec) -> None:
        """Choose the scale at which all that is played on or seen on the screen fits."""
        self._spec = spec
        left, bottom, right, top = _united(spec.region, screen_of(spec))
        width, height = right - left + 2 * MARGIN, top - bottom + 2 * MARGIN
        self._scale = FINE * min(WIDTH / width, HEIGHT / height)  # pixels a unit
        self._left = (left + right) / 2 - WIDTH * FINE / self._scale / 2
        self._top = (bottom + top) / 2 + HEIGHT * FINE / self._scale / 2
        self._ground = self._draw_ground()

    def draw(self, row: np.void) -> Image.Image:
        """Return the picture of a game, a record of `state.GAME`."""
        picture = self._ground.copy()
        if self._spec.fog:
            self._fog(picture, row["visibility"])
        pen = ImageDraw.Draw(picture)
        self._draw_base(pen, row)
        self._draw_units(pen, row)
        pen.rectangle(self._area(screen_of(self._spec)), None, shapes.FRAME, FINE)
        self._draw_command(pen, row)
        return picture.reduce(FINE)

    def _xy(self, x: float, y: float) -> tuple[float, float]:
        """Return the pixel of a point of the map."""
        return (x - self._left) * self._scale, (self._top - y) * self._scale

    def _box(self, x: float, y: float, half_x: float, half_y: float) -> list[tuple[float, float]]:
        return [self._xy(x - half_x, y + half_y), self._xy(x + half_x, y - half_y)]

    def _area(self, area: Rectangle) -> list[tuple[float, float]]:
        return [self._xy(area.left, area.top), self._xy(area.right, area.bottom)]

    def _draw_ground(self) -> Image.Image:
        """Draw what never changes."""
        picture = Image.new("RGB", (WIDTH * FINE, HEIGHT * FINE), OUTSIDE)
        pen = ImageDraw.Draw(picture)
        pen.rectangle(self._area(self._spec.region), GROUND)
        return picture

    def _fog(self, picture: Image.Image, visibility: NDArray[np.uint8]) -> None:
        """Darken the cells of the map (64, 64) that are hidden, and less those once seen."""
        region = self._spec.region
        cells = Image.fromarray(SHADES[visibility[::-1]])
        (left, top), (right, bottom) = self._area(region)
        width, height = round(right) - round(left), round(bottom) - round(top)
        box = (
            region.left,
            game.MAP_SIZE - region.top,
            region.right,
            game.MAP_SIZE - region.bottom,
        )
        smooth = cells.resize((width // 4, height // 4), Image.Resampling.BILINEAR, box)
        shown = smooth.resize((width, height), Image.Resampling.NEAREST)
        picture.paste(shown, (round(left), round(top)))

    # What stands

    def _draw_base(self, pen: Pen, row: np.void) -> None:
        """Draw the base's border, minerals, and structures with how far they are built."""
        if self._spec.base is None:
            return
        pen.rectangle(self._area(self._spec.base), None, BASE_LINE, FINE)
        for k, (x, y) in enumerate(self._spec.patches):
            if row["patch_left"][k] > 0:
                half = game.PATCH_HALF_WIDTH - 0.1, game.PATCH_HALF_HEIGHT - 0.1
                pen.rounded_rectangle(self._box(x, y, *half), 2 * FINE, shapes.MINERALS, style.INK)
        kind, index = int(row["selected_kind"]), int(row["selected_index"])
        chosen = kind == states.THE_CENTRE
        self._structure(pen, self._spec.centre, game.COMMAND_CENTRE.radius, "CC", 1.0, chosen)
        for name, letter, data, which in (
            ("depot", "D", game.DEPOT, states.ONE_DEPOT),
            ("barracks", "B", game.BARRACKS, states.ONE_BARRACKS),
        ):
            for i in np.flatnonzero(row[f"{name}_done"]):
                share = (row["loop"] - row[f"{name}_begun"][i]) / data.build_loops
                place = float(row[f"{name}_x"][i]), float(row[f"{name}_y"][i])
                chosen = kind == which and index == i
                self._structure(pen, place, data.radius, letter, min(1.0, float(share)), chosen)

    def _structure(
        self, pen: Pen, place: tuple[float, float], half: float, letter: str, share: float,
        chosen: bool,
    ) -> None:  # fmt: skip
        """Draw a square with a letter; of one that is being built, as much as there is."""
        (left, top), (right, bottom) = self._box(*place, half - 0.08, half - 0.08)
        pen.rectangle([left, top, right, bottom], "#f7f6f2", style.FAINT, FINE)
        if share > 0:
            pen.rectangle([left, bottom - share * (bottom - top), right, bottom], shapes.STRUCTURE)
        line = (style.INK, 2 * FINE) if chosen else (style.FAINT, FINE)
        pen.rectangle([left, top, right, bottom], None, *line)
        size = max(9 * FINE, int(0.75 * half * self._scale))
        middle = ((left + right) / 2, (top + bottom) / 2)
        pen.text(middle, letter, style.INK, font(size, "-Bold"), anchor="mm")
        if chosen:
            self._draw_ring(pen, middle, (right - left) / 2 * 1.2)

    # What moves

    def _draw_units(self, pen: Pen, row: np.void) -> None:
        """Draw SCVs, zerglings, which the player may not see, and marines."""
        one_scv = int(row["selected_index"]) if row["selected_kind"] == states.ONE_SCV else -1
        for i in np.flatnonzero(row["scv_state"]):
            point = self._xy(float(row["scv_x"][i]), float(row["scv_y"][i]))
            self._draw_unit(pen, "square", point, shapes.SCV, i == one_scv)
        for i in np.flatnonzero(row["zergling_hp"] > 0):
            x, y = float(row["zergling_x"][i]), float(row["zergling_y"][i])
            visible = row["visibility"][int(y), int(x)] == game.VISIBLE
            shape = "triangle" if visible else "outline"
            self._draw_unit(pen, shape, self._xy(x, y), shapes.ZERGLING, False)
        for i in np.flatnonzero(row["marine_hp"] > 0):
            point = self._xy(float(row["marine_x"][i]), float(row["marine_y"][i]))
            self._draw_unit(pen, "disc", point, shapes.MARINE, bool(row["marine_selected"][i]))

    def _draw_unit(
        self, pen: Pen, shape: str, point: shapes.Point, colour: str, chosen: bool
    ) -> None:
        """Draw a unit, all of which are of one size, and a ring around one that is selected."""
        size = max(LEAST_RADIUS * FINE, game.MARINE.radius * self._scale)
        line = FINE if shape == "outline" else FINE // 2
        shapes.draw_shape(pen, shape, point, size, colour, line)
        if chosen:
            self._draw_ring(pen, point, (2.0 if shape == "square" else 1.6) * size)

    def _draw_ring(self, pen: Pen, point: shapes.Point, radius: float) -> None:
        pen.circle(point, radius + FINE, None, style.INK, 3 * FINE)
        pen.circle(point, radius, None, "#ffffff", FINE)

    def _draw_command(self, pen: Pen, row: np.void) -> None:
        """Mark the point of the last command, where it has one."""
        if row["last_command"] in WITH_A_POINT:
            point = self._xy(*self.point_of(int(row["last_x"]), int(row["last_y"])))
            shape, colour = "cross", shapes.CLICK
            if row["last_refused"]:
                shape, colour = "x", shapes.REFUSED
            for width, ink in ((5, "#ffffff"), (2, colour)):
                shapes.draw_shape(pen, shape, point, 9 * FINE, ink, width * FINE)

    def point_of(self, column: int, row: int) -> tuple[float, float]:
        """Return the point of the map in the middle of a pixel of the screen."""
        screen = screen_of(self._spec)
        pixel = self._spec.camera.width / game.SCREEN
        return screen.left + (column + 0.5) * pixel, screen.top - (row + 0.5) * pixel


def screen_of(spec: MapSpec) -> Rectangle:
    """Return what the screen shows of a map."""
    x, y, width = spec.camera
    return Rectangle(x - width / 2, y - width / 2, x + width / 2, y + width / 2)


def _united(one: Rectangle, other: Rectangle) -> Rectangle:
    """Return the smallest rectangle with both in it."""
    least, most = map(min, one[:2], other[:2]), map(max, one[2:], other[2:])
    return Rectangle(*least, *most)
