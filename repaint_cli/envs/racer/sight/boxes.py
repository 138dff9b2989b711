"""Bots and boxes in the images of a camera and the ranges of a lidar. Metres, radians.

All are boxes on flat ground, of one size for all objects of a car.

Rays are followed in the box's own frame, where it is three pairs of planes.
"""

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
    reach = RANGE + body[LENGTH]
    for row in rows:
        yaw = states[row, 2]
        x = states[row, 0] + BEAM_X * np.cos(yaw)
        y = states[row, 1] + BEAM_X * np.sin(yaw)
        ranges[row] = RANGE
        for b in range(poses.shape[1]):
            box = poses[row, b]
            if (box[0] - x) ** 2 + (box[1] - y) ** 2 > reach * reach:
                continue
            for k in range(beams):
                angle = yaw + np.pi + FIRST_BEAM + BEAM_SPAN * k / (beams - 1)
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
        int(min(max(np.floor(top), 0), rows)), int(min(max(np.ceil(bottom), 0), rows)),
        int(min(max(np.floor(first), 0), columns)), int(min(max(np.ceil(last), 0), columns)),
    )  # fmt: skip


@kernel
def draw_box(
    state: np.ndarray, eye_offset: float, box: np.ndarray, body: np.ndarray, lens: np.ndarray,
    image: np.ndarray,
) -> None:  # fmt: skip
    """Draw one box over the camera image of a car.

    Args:
        state: the car's x, y (m) and heading (rad) first.
        eye_offset: from the car's middle to the camera, to the left, m.
        box: x, y (m) and heading (rad) first.
        body: its size and grey levels, (5,).
        lens: `camera.lens()`, (6,).
        image: changed, (120, 160) uint8.
    """
    rows, columns = image.shape
    forward, height, pitch, focal = lens[0], lens[1], lens[2], lens[5]
    yaw = state[2]
    dx, dy = box[0] - state[0], box[1] - state[1]
    ahead = dx * np.cos(yaw) + dy * np.sin(yaw) - forward
    left = dy * np.cos(yaw) - dx * np.sin(yaw) - eye_offset
    cos, sin = np.cos(box[2] - yaw), np.sin(box[2] - yaw)
    if ahead < -body[LENGTH]:
        return
    top, bottom, first, last = _bounds(ahead, left, cos, sin, body, lens, (rows, columns))
    ox, oy = -(ahead * cos + left * sin), -(left * cos - ahead * sin)  # the eye, in the box's frame
    half_length, half_width, half_height = body[0] / 2.0, body[1] / 2.0, body[2] / 2.0
    end, side = np.uint8(body[END]), np.uint8(body[SIDE])
    oz = height - half_height
    for r in range(top, bottom):
        v = (r + 0.5 - rows / 2.0) / focal
        run = np.cos(pitch) - v * np.sin(pitch)  # of the ray, ahead of the car
        rise = -np.sin(pitch) - v * np.cos(pitch)
        near_z, far_z = _slab(oz, rise, half_height, 0.0, np.inf)
        if near_z > far_z:
            continue
        for c in range(first, last):
            u = -(c + 0.5 - columns / 2.0) / focal  # to the left
            near_x, far = _slab(ox, run * cos + u * sin, half_length, near_z, far_z)
            near, far = _slab(oy, u * cos - run * sin, half_width, near_x, far)
            if near <= far and near > 0.0:
                image[r, c] = side if near > near_x else end


@kernel
def draw_rows(
    rows: np.ndarray, states: np.ndarray, poses: np.ndarray, body: np.ndarray, eye_offset: float,
    lens: np.ndarray, images: np.ndarray, channel: int,
) -> None:  # fmt: skip
    """Draw the objects of some cars into images (N, 120, 160, C), the farthest first.

    See `draw_box` for the arguments; poses are (N, B, ≥3), rows (K,).
    """
    n_boxes = poses.shape[1]
    far, done = np.empty(n_boxes), np.empty(n_boxes, np.bool_)
    for row in rows:
        for b in range(n_boxes):
            far[b] = np.hypot(poses[row, b, 0] - states[row, 0], poses[row, b, 1] - states[row, 1])
            done[b] = False
        for _ in range(n_boxes):
            next_box = -1
            for b in range(n_boxes):
                if not done[b] and (next_box < 0 or far[b] > far[next_box]):
                    next_box = b
            done[next_box] = True
            draw_box(
                states[row],
                eye_offset,
                poses[row, next_box],
                body,
                lens,
                images[row, :, :, channel],
            )
