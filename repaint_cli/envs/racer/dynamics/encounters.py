"""Encounters of a car with its bots: distances, hazards, crashes, and the next bot. SI units.

All cars have the body of DeepRacer's collision rectangle, centred on the base.
"""

import numpy as np

from repaint_cli.kernels import kernel

BODY_LENGTH, BODY_WIDTH = 0.32352, 0.1961
"""Of the collision rectangle, m."""
CLEAR = 0.8
"""A car further than this from every bot, middle to middle, is clear of them, m."""
HAZARD, HAZARD_ANGLE = 0.5, np.deg2rad(30.0)
"""A bot nearer than this (m) and less than this off the bow (rad) is a hazard."""
NEAR, FAR = 0.2, 300.0
"""Depth of the camera's view of objects, m."""

DISTANCE, HAZARDS, HIT, AT_FAULT, NEXT, NEXT_SEEN = range(6)
"""Columns of the output of `meet`."""


@kernel
def corners_of(x: float, y: float, yaw: float, out: np.ndarray) -> None:
    """Fill `out`, (4, 2), with a body's corners, m."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    for k in range(4):
        ahead = BODY_LENGTH / 2.0 if k < 2 else -BODY_LENGTH / 2.0
        left = BODY_WIDTH / 2.0 if k % 2 == 0 else -BODY_WIDTH / 2.0
        out[k, 0] = x + ahead * cos - left * sin
        out[k, 1] = y + ahead * sin + left * cos


@kernel
def body_touches(box: np.ndarray, corners: np.ndarray) -> bool:
    """Tell whether a body, x, y (m) and heading (rad) first, holds one of another's corners."""
    cos, sin = np.cos(box[2]), np.sin(box[2])
    for k in range(4):
        dx, dy = corners[k, 0] - box[0], corners[k, 1] - box[1]
        ahead, left = dx * cos + dy * sin, dy * cos - dx * sin
        if abs(ahead) <= BODY_LENGTH / 2.0 and abs(left) <= BODY_WIDTH / 2.0:
            return True
    return False


@kernel
def off_bow(state: np.ndarray, box: np.ndarray) -> float:
    """Return by how much the direction to a box differs from a car's heading, rad, at least 0."""
    bearing = np.arctan2(box[1] - state[1], box[0] - state[0]) - state[2]
    return float(abs(np.arctan2(np.sin(bearing), np.cos(bearing))))


@kernel
def in_view(state: np.ndarray, lens: np.ndarray, px: float, py: float) -> bool:
    """Tell whether a car's camera has the ground point (px, py) in its picture.

    Args:
        state: the car's x, y (m) and heading (rad) first.
        lens: `camera.lens()`, (6,).
        px: x, m.
        py: y, m.
    """
    ahead, height, pitch, half_width, half_height = lens[0], lens[1], lens[2], lens[3], lens[4]
    cos, sin = np.cos(state[2]), np.sin(state[2])
    x = (px - state[0]) * cos + (py - state[1]) * sin - ahead
    y = (py - state[1]) * cos - (px - state[0]) * sin
    depth = x * np.cos(pitch) + height * np.sin(pitch)
    down = height * np.cos(pitch) - x * np.sin(pitch)
    within = abs(y) <= depth * half_width and abs(down) <= depth * half_height
    return bool(NEAR <= depth <= FAR and within)


@kernel
def body_in_view(state: np.ndarray, lens: np.ndarray, box: np.ndarray, corners: np.ndarray) -> bool:
    """Tell whether the middle or a corner of a body is in a car's picture; fills `corners`."""
    corners_of(box[0], box[1], box[2], corners)
    visible = in_view(state, lens, box[0], box[1])
    for k in range(4):
        visible = visible or in_view(state, lens, corners[k, 0], corners[k, 1])
    return bool(visible)


@kernel
def meet(
    rows: np.ndarray, states: np.ndarray, along: np.ndarray, length: float, poses: np.ndarray,
    bots_along: np.ndarray, lens: np.ndarray, out: np.ndarray,
) -> None:  # fmt: skip
    """Measure the encounters of some cars with their bots.

    A car hits a bot when one of its corners is inside the bot's body, and is at fault when that bot
    is less than half a lap ahead. The next bot is the first ahead, seen if `body_in_view`.

    Args:
        rows: which cars, (K,).
        states: base x, y (m) and heading (rad) first, (N, ≥3).
        along: arclength of the cars along the centre line, (N,), m.
        length: of the track, m.
        poses: `Bots.poses`, (N, B, 4).
        bots_along: `Bots.along`, (N, B), m.
        lens: `camera.lens()`, (6,).
        out: filled with DISTANCE to the nearest bot (m), number of HAZARDS and of bots HIT,
            AT_FAULT, which bot is NEXT, and NEXT_SEEN, (N, 6).
    """
    corners, ahead = np.empty((4, 2)), np.empty(poses.shape[1])
    for row in rows:
        state, encounter = states[row], out[row]
        encounter[DISTANCE], encounter[HAZARDS], encounter[HIT] = np.inf, 0, 0
        encounter[AT_FAULT] = 0
        for bot in range(poses.shape[1]):
            box = poses[row, bot]
            ahead[bot] = (bots_along[row, bot] - along[row]) % length
            gap = np.hypot(box[0] - state[0], box[1] - state[1])
            encounter[DISTANCE] = min(encounter[DISTANCE], gap)
            if gap < HAZARD and off_bow(state, box) < HAZARD_ANGLE:
                encounter[HAZARDS] += 1
            corners_of(state[0], state[1], state[2], corners)
            if body_touches(box, corners):
                encounter[HIT] += 1
                if ahead[bot] < length / 2.0:
                    encounter[AT_FAULT] = 1
        nearest = np.argmin(ahead)
        encounter[NEXT] = nearest
        encounter[NEXT_SEEN] = body_in_view(state, lens, poses[row, nearest], corners)
