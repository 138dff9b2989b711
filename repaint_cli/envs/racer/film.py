"""An episode as a film: the track from above, the camera's image, and numbers.

The map is drawn once; a frame adds a piece of the path and the cars to it. Metres, radians, m/s.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from io import BytesIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from repaint_cli.envs.racer.dynamics.car import FRONT_OFFSET
from repaint_cli.envs.racer.road import BOX_COLOUR, CAR_LENGTH, CAR_WIDTH, body_corners, draw_road
from repaint_cli.envs.racer.sight.boxes import BEAM_SPAN, FIRST_BEAM, RANGE
from repaint_cli.envs.racer.track.geometry import Floats
from repaint_cli.report import style
from repaint_cli.report.video import Frame, font

MAP_WIDTH, SIDE_WIDTH, HEIGHT = 640, 480, 480
FINE = 2
"""The map is drawn this many times finer and averaged, so that edges are smooth."""
BEAM_ANGLES = np.deg2rad(np.rint(np.rad2deg(np.pi + FIRST_BEAM + np.array([0, BEAM_SPAN]))))
"""Of the lidar's first and last beam in whole degrees, to the left from straight ahead, rad."""
CAR_COLOUR, BOT_COLOUR = "#009E73", "#666666"
CAR_SIZE = (CAR_LENGTH, CAR_WIDTH)
CAMERA_HEIGHT = 360
LIDAR_SIZE = 120
"""Of the lidar's view in the corner of the camera's, pixels."""
COLUMN = SIDE_WIDTH / 4

ToPixels = Callable[[Floats], Floats]
"""From metres (n, 2) to pixels of the fine map, whose y axis points down."""


@dataclass(frozen=True)
class FilmedEpisode:
    """Each of an episode's T steps."""

    xy: Floats
    """The car's base point, midway between the axles, (T, 2), m."""
    heading: Floats
    """Counter-clockwise from the x axis, (T,), rad."""
    speed: Floats
    """(T,), m/s."""
    steering: Floats
    """Positive to the left, (T,), rad."""
    progress: Floats
    """Share of the lap, (T,), per cent."""
    reward: Floats
    """(T,)."""
    images: NDArray[np.uint8]
    """Of the (left) camera, grey, (T, H, W)."""
    ranges: Floats
    """Of the lidar, from ahead on the left around the back to the right, (T, B), m; B is 0 without
    one."""
    objects: Floats
    """Other cars' or boxes' x, y (m) and heading (rad), (T, B, 3)."""
    box_size: tuple[float, float] = (0.0, 0.0)
    """Length and width of boxes, m."""
    are_boxes: bool = False
    """Whether they are boxes."""

    def __post_init__(self) -> None:
        for field in fields(self):
            if not isinstance(getattr(self, field.name), np.ndarray):
                continue
            n_steps = len(getattr(self, field.name))
            if n_steps != len(self.xy):
                raise ValueError(f"{field.name} has {n_steps} steps, xy has {len(self.xy)}")


def racer_frames(
    inner: Floats, outer: Floats, centre: Floats, episode: FilmedEpisode, title: str
) -> Iterator[Frame]:
    """Yield one frame a step, (480, 1120, 3).

    Args:
        inner: border on the infield side, (M, 2), m.
        outer: border on the outfield side, (M, 2), m.
        centre: centre line, (M, 2), m.
        episode: what to show.
        title: over the map, such as "racer-outer · repaint, iteration 20 · episode 1".
    """
    scale = Normalize(0.0, max(0.1, float(episode.speed.max(initial=0.0))))
    road, to_pixels = _map(inner, outer, centre, scale, title)
    points = to_pixels(episode.xy)  # (T, 2)
    colours = [to_hex(colour) for colour in style.ramp()(scale(episode.speed))]
    board, returns = _board(), np.cumsum(episode.reward)
    pen = ImageDraw.Draw(road)
    for t in range(len(points)):
        trail = [tuple(point) for point in points[max(t - 1, 0) : t + 1]]
        pen.line(trail, colours[t], width=3 * FINE)
        view = road.copy()
        for x, y, heading in episode.objects[t].tolist():
            if episode.are_boxes:
                _draw_box(view, to_pixels(body_corners(x, y, heading, episode.box_size)))
            else:
                _draw_car(view, to_pixels(_car(x, y, heading)), BOT_COLOUR)
        _draw_car(
            view,
            to_pixels(_car(episode.xy[t, 0], episode.xy[t, 1], float(episode.heading[t]))),
            CAR_COLOUR,
        )
        side = board.copy()
        _draw_numbers(side, episode, t, float(returns[t]))
        frame = np.empty((HEIGHT, MAP_WIDTH + SIDE_WIDTH, 3), np.uint8)
        frame[:, :MAP_WIDTH] = np.asarray(view.reduce(FINE))
        frame[:, MAP_WIDTH:] = np.asarray(side)
        yield frame


def _map(
    inner: Floats, outer: Floats, centre: Floats, scale: Normalize, title: str
) -> tuple[Image.Image, ToPixels]:
    """Draw the still parts, and return them with the function from metres to their pixels."""
    figure = Figure((MAP_WIDTH / 100, HEIGHT / 100), dpi=100 * FINE, facecolor="white")
    FigureCanvasAgg(figure)
    figure.text(0.5, 0.955, title, ha="center", va="center", weight="bold", color=style.INK)
    axes = figure.add_axes((0.02, 0.14, 0.96, 0.77))
    axes.set_axis_off()
    axes.set_aspect("equal")
    draw_road(axes, inner, outer, centre)
    _ruler(figure, axes)
    bar = figure.colorbar(
        ScalarMappable(scale, style.ramp()),
        cax=figure.add_axes((0.55, 0.095, 0.4, 0.022)),
        orientation="horizontal",
    )
    bar.set_label("speed [m/s]", size=style.NOTE_SIZE, labelpad=1)
    bar.ax.tick_params(labelsize=style.NOTE_SIZE, length=2, pad=1)
    style.disable_mathtext(figure)
    picture = BytesIO()
    figure.savefig(picture, dpi=100 * FINE)
    matrix = axes.transData.get_affine().get_matrix()

    def to_pixels(xy: Floats) -> Floats:
        upward = xy @ matrix[:2, :2].T + matrix[:2, 2]
        return np.asarray(upward * [1, -1] + [0, HEIGHT * FINE])

    return Image.open(picture).convert("RGB"), to_pixels


def _ruler(figure: Figure, axes: Axes) -> None:
    """Draw one metre, so that the map has a unit."""
    figure.draw_without_rendering()  # the aspect is settled only now
    ends = axes.transData.transform([[0.0, 0.0], [1.0, 0.0]])[:, 0]
    length = float(ends[1] - ends[0]) / (MAP_WIDTH * FINE)
    line = Line2D([0.06, 0.06 + length], [0.105, 0.105], color=style.INK, linewidth=2)
    figure.add_artist(line)
    figure.text(0.06, 0.06, "1 m", size=style.NOTE_SIZE, color=style.INK, va="center")


def _car(x: float, y: float, heading: float) -> Floats:
    """Return a car's four corners and then its front point, (5, 2), m."""
    front = [x + FRONT_OFFSET * np.cos(heading), y + FRONT_OFFSET * np.sin(heading)]
    return np.vstack([body_corners(x, y, heading, CAR_SIZE), front])


def _draw_box(view: Image.Image, corners: Floats) -> None:
    outline = [tuple(point) for point in corners]
    ImageDraw.Draw(view).polygon(outline, BOX_COLOUR, style.INK, width=FINE)


def _draw_car(view: Image.Image, body: Floats, colour: str) -> None:
    *corners, front = [tuple(point) for point in body]
    pen = ImageDraw.Draw(view)
    pen.polygon(corners, colour)
    pen.line([*corners, corners[0]], style.INK, width=FINE)
    pen.circle(front, 2 * FINE, "white")


def _board() -> Image.Image:
    """Draw the frame around the camera's picture and the names of the numbers."""
    board = Image.new("RGB", (SIDE_WIDTH, HEIGHT), "white")
    pen = ImageDraw.Draw(board)
    for column, name in enumerate(("speed", "steering", "progress", "reward")):
        pen.text((COLUMN * (column + 0.5), 382), name, "#555555", font(14), anchor="mm")
    return board


def _draw_numbers(side: Image.Image, episode: FilmedEpisode, t: int, total: float) -> None:
    """Put the camera's picture and the numbers of step `t` on the board."""
    side.paste(_enlarged(episode.images[t]), (0, 0))
    if episode.ranges.shape[1]:
        view = _scan_view(episode.ranges[t])
        side.paste(view, (8, CAMERA_HEIGHT - view.height - 8))
    pen = ImageDraw.Draw(side)
    numbers = (
        f"{episode.speed[t]:.2f} m/s",
        f"{round(float(np.rad2deg(episode.steering[t]))):+d}°",
        f"{episode.progress[t]:.1f} %",
        _signed(float(episode.reward[t])),
    )
    for column, number in enumerate(numbers):
        text = number.replace("-", "−")
        pen.text((COLUMN * (column + 0.5), 408), text, style.INK, font(20, "-Bold"), anchor="mm")
    height, width = episode.images.shape[1:]
    steps = f"step {t + 1} of {len(episode.xy)}"
    shown = f"{total:.1f}" if abs(total) >= 10 else f"{total:.3g}"
    below = f"camera {width}×{height}  ·  {steps}  ·  return {shown}".replace("-", "−")
    pen.text((SIDE_WIDTH / 2, 450), below, "#555555", font(14), anchor="mm")


def _signed(reward: float) -> str:
    """Write a reward with two digits, or more where it is small."""
    return f"{reward:+.2f}" if reward == 0 or abs(reward) >= 0.1 else f"{reward:+.2g}"


def _scan_view(ranges: Floats) -> Image.Image:
    """Draw the lidar's beams around the car, which points up; those that meet a car are yellow."""
    size, middle = LIDAR_SIZE * FINE, LIDAR_SIZE * FINE / 2
    view = Image.new("RGB", (size, size), "#15171c")
    pen = ImageDraw.Draw(view)
    metre = middle - 6 * FINE
    for ahead, left, free in beam_ends(ranges):
        end = (middle - left * metre, middle - ahead * metre)
        pen.line([(middle, middle), end], "#3d434d" if free else "#ffc233", width=FINE)
    half = np.array([CAR_WIDTH, CAR_LENGTH]) / 2 * metre
    pen.rectangle([*(middle - half), *(middle + half)], CAR_COLOUR, "white")
    pen.text((4 * FINE, 2 * FINE), "lidar, 1 m", "#c8ccd4", font(9 * FINE))
    return view.reduce(FINE)


def beam_ends(ranges: Floats) -> Iterator[tuple[float, float, bool]]:
    """Yield where each beam (B,) ends, ahead and to the left of the lidar (m), and whether free."""
    angles = np.linspace(BEAM_ANGLES[0], BEAM_ANGLES[1], len(ranges))
    for angle, reach in zip(angles, ranges, strict=True):
        yield float(np.cos(angle) * reach), float(np.sin(angle) * reach), bool(reach >= RANGE)


def _enlarged(image: NDArray[np.uint8]) -> Image.Image:
    """Show every pixel of a grey picture as a square, in a box of 480 × 360."""
    height, width = image.shape
    times = min(SIDE_WIDTH / width, CAMERA_HEIGHT / height)
    size = (round(width * times), round(height * times))
    return Image.fromarray(image).resize(size, Image.Resampling.NEAREST)
