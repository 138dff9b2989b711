"""The camera: 160 × 120 grey pixels of flat ground, four walls and a sky. Metres, radians.

The camera is fixed to the car and the ground is flat, so every row of pixels looks at one line of
the car's frame, and a picture is a straight walk through the painted ground for each row. Rows
above the horizon do the same with the plane at the height of the walls' tops: what meets that plane
inside the field is sky.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.sight.ground import LEVELS, TEXEL
from repaint_cli.kernels import kernel

WIDTH, HEIGHT = 160, 120
CAMERA_X, CAMERA_Z = 0.14529379, 0.13032555
"""Ahead of the car's base, and above the ground, m."""
PITCH = 0.2618
"""Downwards, rad."""
HORIZONTAL_VIEW = 1.13
"""Angle of view from left to right, rad."""
FOCAL = WIDTH / 2 / np.tan(HORIZONTAL_VIEW / 2)
"""In pixels."""
WALL_HEIGHT = 1.0
SKY = 175
WALLS = np.array([24, 36, 48, 60], dtype=np.uint8)
"""Grey levels at least x, greatest x, least y, greatest y; unequal, to tell directions."""
WALLS.flags.writeable = False

EYE_OFFSETS = (0.0,)
"""From the car's middle to the left, of the single camera, m."""
STEREO_EYE_OFFSETS = (0.03, -0.03)
"""The same of two cameras, left and right, m."""

AHEAD, SIDE, LEVEL, SIZE, SKYWARD = range(5)
"""Columns of `row_table`."""


def lens() -> NDArray[np.float64]:
    """Return the camera's constants as kernels read them, (6,).

    They are its distance ahead of the base (m), its height (m), its pitch (rad), the tangents of
    half its horizontal and half its vertical angle of view, and its focal length (pixels).
    """
    half = np.array([WIDTH, HEIGHT]) / 2 / FOCAL
    return np.array([CAMERA_X, CAMERA_Z, PITCH, *half, FOCAL])


def row_table() -> NDArray[np.float64]:
    """Return the line of the ground that each row of pixels shows, (120, 5).

    Returns:
        AHEAD: the line's distance ahead of the base, m;
        SIDE: the distance between its pixels on that line, m (the first is farthest left);
        LEVEL: the level of the ground picture with texels of that size;
        SIZE: the edge of its texels, m;
        SKYWARD: 1 for rows above the horizon, which show the plane of the walls' tops.
    """
    down = (np.arange(HEIGHT) + 0.5 - HEIGHT / 2) / FOCAL  # (120,)
    sink = np.sin(PITCH) + down * np.cos(PITCH)  # of a ray, per unit along the optical axis
    skyward = sink < 0
    reach = np.where(skyward, CAMERA_Z - WALL_HEIGHT, CAMERA_Z) / sink
    side = reach / FOCAL
    level = np.clip(np.floor(np.log2(side / TEXEL)), 0, LEVELS - 1)
    ahead = CAMERA_X + reach * (np.cos(PITCH) - down * np.sin(PITCH))
    return np.stack([ahead, side, level, TEXEL * 2**level, skyward], axis=1)


@kernel
def _inside_span(start: float, step: float, low: float, high: float) -> tuple[int, int]:
    """Return the first pixel k and the end of those with low < start + k·step < high."""
    if step == 0.0:
        return (0, WIDTH) if low < start < high else (0, 0)
    a, b = (low - start) / step, (high - start) / step
    first, end = min(max(min(a, b), -1.0), WIDTH), min(max(max(a, b), 0.0), WIDTH)
    return min(math.floor(first) + 1, WIDTH), math.ceil(end)


@kernel
def wall_luma(
    x: float, y: float, dx: float, dy: float, field: np.ndarray, walls: np.ndarray
) -> Any:
    """Return the grey level of the wall that a ray from (x, y) towards (dx, dy) meets first."""
    to_x = field[2] - x if dx > 0.0 else x - field[0]
    to_y = field[3] - y if dy > 0.0 else y - field[1]
    if to_x * abs(dy) < to_y * abs(dx):
        return walls[1] if dx > 0.0 else walls[0]
    return walls[3] if dy > 0.0 else walls[2]


@kernel
def ground_luma(k: int, u: Any, v: Any, du: Any, dv: Any, level: Any) -> Any:
    """Return the grey level at texel (u + k·du, v + k·dv), float32, by a bilinear look-up."""
    # unsigned: numba need not look for negative indices
    one, half = np.uint32(1), np.float32(0.5)
    uk, vk = u + np.float32(k) * du, v + np.float32(k) * dv
    c, r = np.uint32(np.int32(uk)), np.uint32(np.int32(vk))
    fu, fv = uk - np.float32(c), vk - np.float32(r)
    a, b = np.float32(level[r, c]), np.float32(level[r, c + one])
    low = a + fu * (b - a)
    a, b = np.float32(level[r + one, c]), np.float32(level[r + one, c + one])
    return np.uint8(np.int32(low + fv * (a + fu * (b - a) - low) + half))


@kernel
def eye_at(state: np.ndarray, eye_offset: float) -> tuple[float, float, float, float]:
    """Return cosine and sine of a car's heading, and where a camera of it is, x and y, m."""
    cos, sin = np.cos(state[2]), np.sin(state[2])
    x = state[0] + CAMERA_X * cos - eye_offset * sin
    return cos, sin, x, state[1] + CAMERA_X * sin + eye_offset * cos


@kernel
def row_at(
    state: np.ndarray, eye_offset: float, cos: float, sin: float, look: np.ndarray,
    field: np.ndarray,
) -> tuple[float, float, float, float, int, int]:  # fmt: skip
    """Return which points a row of pixels shows, those of the plane that it looks at.

    Args:
        state: as in `render`, like the next.
        eye_offset: to the left.
        cos: of the car's heading.
        sin: of the car's heading.
        look: the row's line of the table, (5,).
        field: of the ground.

    Returns:
        x and y of the first pixel, m, the step to each next one, m, and the first pixel and the end
        of those inside the field; the others show walls.
    """
    ahead, side = look[AHEAD], look[SIDE]
    left = (WIDTH / 2 - 0.5) * side + eye_offset
    x, y = state[0] + ahead * cos - left * sin, state[1] + ahead * sin + left * cos
    dx, dy = side * sin, -side * cos
    first_x, end_x = _inside_span(x, dx, field[0], field[2])
    first_y, end_y = _inside_span(y, dy, field[1], field[3])
    first = max(first_x, first_y)
    return x, y, dx, dy, first, max(min(end_x, end_y), first)


@kernel
def texels_at(
    x: float, y: float, dx: float, dy: float, look: np.ndarray, origin: np.ndarray
) -> tuple[Any, Any, Any, Any]:
    """Return `row_at`'s first point and step in texels of the row's level, float32."""
    size = look[SIZE]
    u, v = (x - origin[0]) / size - 0.5, (y - origin[1]) / size - 0.5
    return np.float32(u), np.float32(v), np.float32(dx / size), np.float32(dy / size)


@kernel
def render(
    state: np.ndarray, eye_offset: float, table: np.ndarray, levels: tuple[np.ndarray, ...],
    origin: np.ndarray, field: np.ndarray, walls: np.ndarray, image: np.ndarray,
) -> None:  # fmt: skip
    """Draw the camera image of one car.

    Args:
        state: the car's x, y (m) and heading (rad) first, (5,).
        eye_offset: from the car's middle to the camera, to the left, m.
        table: `row_table()`, (120, 5).
        levels: `Ground.levels`.
        origin: `Ground.origin`, (2,), m.
        field: `Ground.field`, (4,), m.
        walls: `WALLS`, (4,).
        image: filled, (120, 160) uint8.
    """
    cos, sin, eye_x, eye_y = eye_at(state, eye_offset)
    for row in range(HEIGHT):
        look, line = table[row], image[row]
        x, y, dx, dy, first, end = row_at(state, eye_offset, cos, sin, look, field)
        for k in range(first):
            line[k] = wall_luma(eye_x, eye_y, x + k * dx - eye_x, y + k * dy - eye_y, field, walls)
        for k in range(end, WIDTH):
            line[k] = wall_luma(eye_x, eye_y, x + k * dx - eye_x, y + k * dy - eye_y, field, walls)
        if look[SKYWARD] > 0.0:
            line[first:end] = SKY
            continue
        u, v, du, dv = texels_at(x, y, dx, dy, look, origin)
        level = levels[int(look[LEVEL])]
        for k in range(first, end):
            line[k] = ground_luma(k, u, v, du, dv, level)


@kernel
def render_rows(
    rows: np.ndarray,
    states: np.ndarray,
    eye_offset: float,
    table: np.ndarray,
    levels: tuple[np.ndarray, ...],
    origin: np.ndarray,
    field: np.ndarray,
    walls: np.ndarray,
    images: np.ndarray,
    channel: int,
) -> None:
    """Draw the camera images of some cars (K,) into a channel of images (N, 120, 160, C).

    See `render` for the other arguments.
    """
    for row in rows:
        image = images[row, :, :, channel]
        render(states[row], eye_offset, table, levels, origin, field, walls, image)
