"""Bots and boxes in the images of a camera and the ranges of a lidar. Metres, radians.

All are boxes on flat ground, of one size for all objects of a car.

Rays are followed in the box's own frame, where it is three pairs of planes.
"""

import math

import numpy as np

from repaint_cli.kernels import kernel

BOT_LENGTH, BOT_WIDTH, BOT_HEIGHT = 0.324, 0.188, 0.21
"""Of a bot's visible body, m; its collision rectangle is in `dynamics.encounters`."""
END_LUMA, SIDE_LUMA = 40, 28
"""Grey levels of a bot's faces, apart so that its heading can be seen; no camera sees its top."""
CARTON_END_LUMA, CARTON_SIDE_LUMA = 150, 118
"""The same of a box of cardboard."""
LENGTH, WIDTH, HEIGHT, END, SIDE = range(5)
"""Columns of a body as kernels read it: its size (m) and the grey levels of its faces."""
BOT = np.array([BOT_LENGTH, BOT_WIDTH, BOT_HEIGHT, END_LUMA, SIDE_LUMA])
BOT.flags.writeable = False
BEAM_X = 0.02913
"""From the base to the lidar, ahead, m."""
FIRST_BEAM, BEAM_SPAN = -2.61799, 5.23598
"""Angles from straight back to the first beam, and from it to the last, to the left, rad."""
RANGE = 1.0
"""Of a beam; the reading of one that meets nothing, m."""
COS, SIN, EYE_X, EYE_Y, TOP, BOTTOM, FIRST, LAST = range(8)
"""Columns of a box as an eye has it in view: its turn from the car's heading, where the eye is in
the box's frame (m), and the rows and columns of the pixels that may show it."""
VIEW = 8
"""How many columns these are."""


@kernel
def _slab(origin: float, slope: float, half: float, near: float, far: float) -> tuple[float, float]:
    """Return where a ray is between two planes at ±half, within near..far already known."""
    if abs(slope) < 1e-12:
        return (near, far) if abs(origin) <= half else (1.0, 0.0)
    a, b = (-half - origin) / slope, (half - origin) / slope
    return max(near, min(a, b)), min(far, max(a, b))


@kernel
def beam(x: float, y: float, angle: float, box: np.ndarray, body: np.ndarray) -> float:
    """Return how far a horizontal ray runs from (x, y) to a box, or infinity.

    Args:
        x: of its origin, m.
        y: of its origin, m.
        angle: of its direction, rad.
        box: x, y (m) and heading (rad) first.
        body: its size, (5,).
    """
    cos, sin = np.cos(box[2]), np.sin(box[2])
    dx, dy = x - box[0], y - box[1]
    rx, ry = np.cos(angle), np.sin(angle)
    near, far = _slab(dx * cos + dy * sin, rx * cos + ry * sin, body[LENGTH] / 2.0, 0.0, np.inf)
    near, far = _slab(dy * cos - dx * sin, ry * cos - rx * sin, body[WIDTH] / 2.0, near, far)
    return near if near <= far else np.inf


@kernel
def lidar_at(state: np.ndarray) -> tuple[float, float]:
    """Return where a car's lidar is, x and y, m."""
    return state[0] + BEAM_X * np.cos(state[2]), state[1] + BEAM_X * np.sin(state[2])


@kernel
def in_reach(x: float, y: float, box: np.ndarray, body: np.ndarray) -> bool:
    """Tell whether a beam from (x, y) can reach a box."""
    reach = RANGE + body[LENGTH]
    return bool((box[0] - x) ** 2 + (box[1] - y) ** 2 <= reach * reach)


@kernel
def beam_angle(yaw: float, k: int, beams: int) -> float:
    """Return the direction of beam k of a lidar on a car that heads to `yaw`, rad."""
    return yaw + np.pi + FIRST_BEAM + BEAM_SPAN * k / (beams - 1)


@kernel
def scan_rows(
    rows: np.ndarray, states: np.ndarray, poses: np.ndarray, body: np.ndarray, ranges: np.ndarray
) -> None:
    """Measure the ranges of some cars' lidars, without noise.

    Args:
        rows: which cars, (K,).
        states: base x, y (m) and heading (rad) first, (N, ≥3).
        poses: of their objects, (N, B, ≥3).
        body: of all objects, (5,).
        ranges: filled, (N, beams), m; `RANGE` where nothing is nearer.
    """
    beams = ranges.shape[1]
    for row in rows:
        x, y = lidar_at(states[row])
        ranges[row] = RANGE
        for b in range(poses.shape[1]):
            box = poses[row, b]
            if in_reach(x, y, box, body):
                for k in range(beams):
                    angle = beam_angle(states[row, 2], k, beams)
                    ranges[row, k] = min(ranges[row, k], beam(x, y, angle, box, body))


@kernel
def _bounds(
    ahead: float, left: float, cos: float, sin: float, body: np.ndarray, lens: np.ndarray,
    size: tuple[int, int],
) -> tuple[int, int, int, int]:  # fmt: skip
    """Return first and end row and column of the pixels that may show a box in the eye's frame."""
    rows, columns = size
    height, pitch, focal = lens[1], lens[2], lens[5]
    top, bottom, first, last = np.inf, -np.inf, np.inf, -np.inf
    for corner in range(8):
        a = body[LENGTH] / 2.0 if corner & 1 else -body[LENGTH] / 2.0
        b = body[WIDTH] / 2.0 if corner & 2 else -body[WIDTH] / 2.0
        z = (body[HEIGHT] if corner & 4 else 0.0) - height
        x, y = ahead + a * cos - b * sin, left + a * sin + b * cos
        depth = x * np.cos(pitch) - z * np.sin(pitch)
        if depth < 0.01:  # beside the eye: it may show anywhere
            return 0, rows, 0, columns
        down = -(x * np.sin(pitch) + z * np.cos(pitch)) / depth * focal + rows / 2.0
        right = -y / depth * focal + columns / 2.0
        top, bottom = min(top, down), max(bottom, down)
        first, last = min(first, right), max(last, right)
    return (
        math.floor(min(max(top, 0.0), rows)), math.ceil(min(max(bottom, 0.0), rows)),
        math.floor(min(max(first, 0.0), columns)), math.ceil(min(max(last, 0.0), columns)),
    )  # fmt: skip


@kernel
def view_box(
    state: np.ndarray, eye_offset: float, box: np.ndarray, body: np.ndarray, lens: np.ndarray,
    size: tuple[int, int], view: np.ndarray,
) -> None:  # fmt: skip
    """Find out how the camera of a car has a box in view.

    Args:
        state: the car's x, y (m) and heading (rad) first.
        eye_offset: from the car's middle to the camera, to the left, m.
        box: x, y (m) and heading (rad) first.
        body: its size and grey levels, (5,).
        lens: `camera.lens()`, (6,).
        size: rows and columns of the image.
        view: filled, (8,); without rows where the box is behind the camera.
    """
    yaw = state[2]
    dx, dy = box[0] - state[0], box[1] - state[1]
    ahead = dx * np.cos(yaw) + dy * np.sin(yaw) - lens[0]
    left = dy * np.cos(yaw) - dx * np.sin(yaw) - eye_offset
    cos, sin = np.cos(box[2] - yaw), np.sin(box[2] - yaw)
    view[TOP], view[BOTTOM] = 0, 0
    if ahead < -body[LENGTH]:
        return
    view[COS], view[SIN] = cos, sin
    view[EYE_X], view[EYE_Y] = -(ahead * cos + left * sin), -(left * cos - ahead * sin)
    view[TOP], view[BOTTOM], view[FIRST], view[LAST] = _bounds(
        ahead, left, cos, sin, body, lens, size
    )  # fmt: skip


@kernel
def draw_box_row(
    r: int, rows: int, columns: int, view: np.ndarray, body: np.ndarray, lens: np.ndarray,
    first: int, stride: int, line: np.ndarray,
) -> None:  # fmt: skip
    """Draw a box over every `stride`-th pixel, from the first on, of a row of an image.

    Args:
        r: which row, from the box's TOP to its BOTTOM.
        rows: of the image.
        columns: of the image.
        view: `view_box`'s answer.
        body: as there, like the next.
        lens: of the camera.
        first: the first pixel, at or after the box's FIRST.
        stride: 1 is all pixels.
        line: changed, (160,) uint8.
    """
    height, pitch, focal = lens[1], lens[2], lens[5]
    cos, sin, ox, oy, last = view[COS], view[SIN], view[EYE_X], view[EYE_Y], int(view[LAST])
    half_length, half_width, half_height = body[0] / 2.0, body[1] / 2.0, body[2] / 2.0
    end, side = np.uint8(body[END]), np.uint8(body[SIDE])
    v = (r + 0.5 - rows / 2.0) / focal
    run = np.cos(pitch) - v * np.sin(pitch)  # of the ray, ahead of the car
    rise = -np.sin(pitch) - v * np.cos(pitch)
    near_z, far_z = _slab(height - half_height, rise, half_height, 0.0, np.inf)
    if near_z > far_z:
        return
    for c in range(first, last, stride):
        u = -(c + 0.5 - columns / 2.0) / focal  # to the left
        near_x, far = _slab(ox, run * cos + u * sin, half_length, near_z, far_z)
        near, far = _slab(oy, u * cos - run * sin, half_width, near_x, far)
        if near <= far and near > 0.0:
            line[c] = side if near > near_x else end


@kernel
def rank_of(state: np.ndarray, poses: np.ndarray, k: int) -> int:
    """Return how many boxes (B, ≥3) are drawn before box k: those that are farther from a car.

    Of equally far ones the first is drawn first.
    """
    far, before = math.hypot(poses[k, 0] - state[0], poses[k, 1] - state[1]), 0
    for other in range(len(poses)):
        away = math.hypot(poses[other, 0] - state[0], poses[other, 1] - state[1])
        if away > far or (away == far and other < k):
            before += 1
    return before


@kernel
def draw_rows(
    rows: np.ndarray, states: np.ndarray, poses: np.ndarray, body: np.ndarray, eye_offset: float,
    lens: np.ndarray, images: np.ndarray, channel: int,
) -> None:  # fmt: skip
    """Draw the objects of some cars into images (N, 120, 160, C), the farthest first.

    See `view_box` for the other arguments; poses are (N, B, ≥3), rows (K,).
    """
    n_boxes, n_rows, n_columns = poses.shape[1], images.shape[1], images.shape[2]
    order, view = np.empty(n_boxes, np.int64), np.empty(VIEW)
    for row in rows:
        image = images[row, :, :, channel]
        for k in range(n_boxes):
            order[rank_of(states[row], poses[row], k)] = k
        for b in order:
            view_box(
                states[row], eye_offset, poses[row, b], body, lens, (n_rows, n_columns), view
            )  # fmt: skip
            first = int(view[FIRST])
            for r in range(int(view[TOP]), int(view[BOTTOM])):
                draw_box_row(r, n_rows, n_columns, view, body, lens, first, 1, image[r])
