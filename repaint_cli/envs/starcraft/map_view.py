"""The map from above, for films: ground, fog, minerals, structures, units, selection, command.

Lengths are the game's units, of which y points up; in pictures it points down.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from repaint_cli.envs.starcraft.names import WITH_A_POINT
from repaint_cli.envs.starcraft.rts import constants as game
from repaint_cli.envs.starcraft.rts import state as states
from repaint_cli.envs.starcraft.rts.maps import MapSpec
from repaint_cli.report import style
from repaint_cli.report.video import font

WIDTH, HEIGHT = 640, 544
"""Of the picture, pixels."""
FINE = 2
"""It is drawn this many times finer and averaged, so that edges are smooth."""
MARGIN = 1.0
"""Around what can be played on, units."""

GROUND, OUTSIDE = "#e9e6dd", "#ffffff"
DARK, DIM = (58, 62, 70), (168, 168, 164)
"""Where nothing was ever seen, and where nothing is seen now."""
BASE_LINE = "#a8a294"
COLOURS = {
    "minerals": "#56B4E9", "structure": "#c9c4b8", "SCV": "#E69F00", "marine": "#0072B2",
    "zergling": "#D55E00",
}  # fmt: skip
"""Of what is on the map; shapes tell them apart, too."""
LEAST_RADIUS = 3.2
"""Of a unit, so that it can be seen, pixels."""
CLICK, REFUSED = "#222222", "#CC79A7"
"""Of the point of a command, and of one that could not be carried out."""

Pen = ImageDraw.ImageDraw


class MapView:
    """Draws one game of a map."""

    def __init__(self, spec: MapSpec) -> None:
        """Choose the scale at which all that can be played on fits the picture."""
        self._spec = spec
        left, bottom, right, top = spec.region
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
        self._draw_command(pen, row)
        return picture.reduce(FINE)

    def _xy(self, x: float, y: float) -> tuple[float, float]:
        """Return the pixel of a point of the map."""
        return (x - self._left) * self._scale, (self._top - y) * self._scale

    def _box(self, x: float, y: float, half_x: float, half_y: float) -> list[tuple[float, float]]:
        return [self._xy(x - half_x, y + half_y), self._xy(x + half_x, y - half_y)]

    def _draw_ground(self) -> Image.Image:
        """Draw what never changes."""
        picture = Image.new("RGB", (WIDTH * FINE, HEIGHT * FINE), OUTSIDE)
        pen = ImageDraw.Draw(picture)
        left, bottom, right, top = self._spec.region
        pen.rectangle([self._xy(left, top), self._xy(right, bottom)], GROUND)
        return picture

    def _fog(self, picture: Image.Image, visibility: NDArray[np.uint8]) -> None:
        """Darken the cells of the map (64, 64) that are hidden, and less those once seen."""
        size = round(self._scale * game.MAP_SIZE)
        place = tuple(round(number) for number in self._xy(0, game.MAP_SIZE))
        for what, colour in ((game.HIDDEN, DARK), (game.SEEN, DIM)):
            cells = Image.fromarray(np.where(visibility[::-1] == what, 255, 0).astype(np.uint8))
            mask = Image.new("L", picture.size)
            mask.paste(cells.resize((size, size), Image.Resampling.BILINEAR), place)
            picture.paste(
                colour, (0, 0), Image.composite(mask, Image.new("L", mask.size), self._inside())
            )

    def _inside(self) -> Image.Image:
        """Return a mask of what can be played on."""
        mask = Image.new("L", (WIDTH * FINE, HEIGHT * FINE))
        left, bottom, right, top = self._spec.region
        ImageDraw.Draw(mask).rectangle([self._xy(left, top), self._xy(right, bottom)], 255)
        return mask

    # What stands

    def _draw_base(self, pen: Pen, row: np.void) -> None:
        """Draw the base's border, minerals, and structures with how far they are built."""
        if self._spec.base is None:
            return
        left, bottom, right, top = self._spec.base
        pen.rectangle([self._xy(left, top), self._xy(right, bottom)], None, BASE_LINE, FINE)
        for k, (x, y) in enumerate(self._spec.patches):
            if row["patch_left"][k] > 0:
                half = game.PATCH_HALF_WIDTH - 0.1, game.PATCH_HALF_HEIGHT - 0.1
                pen.rounded_rectangle(
                    self._box(x, y, *half), 2 * FINE, COLOURS["minerals"], style.INK
                )
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
            pen.rectangle(
                [left, bottom - share * (bottom - top), right, bottom], COLOURS["structure"]
            )
        line = (style.INK, 2 * FINE) if chosen else (style.FAINT, FINE)
        pen.rectangle([left, top, right, bottom], None, *line)
        size = max(7 * FINE, int(0.75 * half * self._scale))
        middle = ((left + right) / 2, (top + bottom) / 2)
        pen.text(middle, letter, style.INK, font(size, "-Bold"), anchor="mm")
        if chosen:
            self._ring(pen, middle, (right - left) / 2 * 1.2)

    # What moves

    def _draw_units(self, pen: Pen, row: np.void) -> None:
        """Draw SCVs as squares, marines as discs, zerglings that are seen as triangles."""
        kind, index = int(row["selected_kind"]), int(row["selected_index"])
        for i in np.flatnonzero(row["scv_state"]):
            point = self._xy(float(row["scv_x"][i]), float(row["scv_y"][i]))
            self._unit(pen, point, game.SCV.radius, COLOURS["SCV"], "square")
            if kind == states.ONE_SCV and index == i:
                self._ring(pen, point, 2 * self._radius(game.SCV.radius))
        for i in np.flatnonzero(row["zergling_hp"] > 0):
            x, y = float(row["zergling_x"][i]), float(row["zergling_y"][i])
            if row["visibility"][int(y), int(x)] == game.VISIBLE:
                shape, colour = "triangle", COLOURS["zergling"]
            else:
                shape, colour = "hidden", COLOURS["zergling"]
            self._unit(pen, self._xy(x, y), game.ZERGLING.radius, colour, shape)
        for i in np.flatnonzero(row["marine_hp"] > 0):
            point = self._xy(float(row["marine_x"][i]), float(row["marine_y"][i]))
            self._unit(pen, point, game.MARINE.radius, COLOURS["marine"], "disc")
            if row["marine_selected"][i]:
                self._ring(pen, point, 1.6 * self._radius(game.MARINE.radius))

    def _radius(self, radius: float) -> float:
        return max(LEAST_RADIUS * FINE, radius * self._scale)

    def _unit(
        self, pen: Pen, point: tuple[float, float], radius: float, colour: str, shape: str
    ) -> None:
        """Draw a unit; one that is "hidden" from the player is an outline."""
        (x, y), size = point, self._radius(radius)
        if shape == "square":
            pen.rectangle([x - size, y - size, x + size, y + size], colour, style.INK)
        elif shape == "disc":
            pen.circle(point, size, colour, style.INK)
        else:
            corners: Sequence[tuple[float, float]] = [
                (x, y - 1.2 * size), (x + 1.1 * size, y + 0.8 * size),
                (x - 1.1 * size, y + 0.8 * size),
            ]  # fmt: skip
            filled = colour if shape == "triangle" else None
            pen.polygon(corners, filled, style.INK if filled else colour, FINE)

    def _ring(self, pen: Pen, point: tuple[float, float], radius: float) -> None:
        """Mark what is selected."""
        pen.circle(point, radius + FINE, None, style.INK, 3 * FINE)
        pen.circle(point, radius, None, "#ffffff", FINE)

    def _draw_command(self, pen: Pen, row: np.void) -> None:
        """Mark the point of the last command, where it has one."""
        if row["last_command"] not in WITH_A_POINT:
            return
        x, y = self._xy(*self.point_of(int(row["last_x"]), int(row["last_y"])))
        reach = 9 * FINE
        lines = [[(x - reach, y), (x + reach, y)], [(x, y - reach), (x, y + reach)]]
        if row["last_refused"]:
            lines = [[(x - reach, y - reach), (x + reach, y + reach)],
                     [(x - reach, y + reach), (x + reach, y - reach)]]  # fmt: skip
        colour = REFUSED if row["last_refused"] else CLICK
        for width, ink in ((4 * FINE, "#ffffff"), (2 * FINE, colour)):
            for line in lines:
                pen.line(line, ink, width)

    def point_of(self, column: int, row: int) -> tuple[float, float]:
        """Return the point of the map in the middle of a pixel of the screen."""
        camera = self._spec.camera
        pixel = camera.width / game.SCREEN
        left, top = camera.x - camera.width / 2, camera.y + camera.width / 2
        return left + (column + 0.5) * pixel, top - (row + 0.5) * pixel
