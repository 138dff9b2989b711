"""Encounters of a car with its bots or boxes: distances, hazards, crashes, and the next. SI units.

All cars have the body of DeepRacer's collision rectangle, centred on the base.
"""

import math

import numpy as np

from repaint_cli.kernels import kernel

BODY_LENGTH, BODY_WIDTH = 0.32352, 0.1961
"""Of a car's collision rectangle, m."""
CAR_BODY = np.array([BODY_LENGTH, BODY_WIDTH])
CAR_BODY.flags.writeable = False
CLEAR = 0.8
"""A car further than this from every object, middle to middle, is clear of them, m."""
HAZARD, HAZARD_ANGLE = 0.5, np.deg2rad(30.0)
"""An object nearer than this (m) and less than this off the bow (rad) is a hazard."""
NEAR, FAR = 0.2, 300.0
"""Depth of the camera's view of objects, m."""

DISTANCE, HAZARDS, HIT, AT_FAULT, NEXT, NEXT_SEEN = range(6)
"""Columns of the output of `meet`."""


@kernel
def corners_of(x: float, y: float, yaw: float, body: np.ndarray, out: np.ndarray) -> None:
    """Fill `out`, (4, 2), with the corners of a body, length and width (2,), m."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    for k in range(4):
        ahead = body[0] / 2.0 if k < 2 else -body[0] / 2.0
        left = body[1] / 2.0 if k % 2 == 0 else -body[1] / 2.0
        out[k, 0] = x + ahead * cos - left * sin
        out[k, 1] = y + ahead * sin + left * cos


@kernel
def body_touches(box: np.ndarray, body: np.ndarray, corners: np.ndarray) -> bool:
    """Tell whether a body (2,) at x, y (m) and heading (rad) holds one of another's corners."""
    cos, sin = np.cos(box[2]), np.sin(box[2])
    for k in range(4):
        dx, dy = corners[k, 0] - box[0], corners[k, 1] - box[1]
        ahead, left = dx * cos + dy * sin, dy * cos - dx * sin
        if abs(ahead) <= body[0] / 2.0 and abs(left) <= body[1] / 2.0:
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
def body_in_view(
    state: np.ndarray, lens: np.ndarray, box: np.ndarray, body: np.ndarray, corners: np.ndarray
) -> bool:
    """Tell whether the middle or a corner of a body is in a car's picture; fills `corners`."""
    corners_of(box[0], box[1], box[2], body, corners)
    visible = in_view(state, lens, box[0], box[1])
    for k in range(4):
        visible = visible or in_view(state, lens, corners[k, 0], corners[k, 1])
    return bool(visible)


@kernel
def meet_one(
    state: np.ndarray, along: float, length: float, poses: np.ndarray, objects_along: np.ndarray,
    own: np.ndarray, body: np.ndarray, lens: np.ndarray, corners: np.ndarray,
    encounter: np.ndarray,
) -> None:  # fmt: skip
    """Measure the encounters of one car; `corners` (4, 2) is to work in, else as in `meet`."""
    encounter[DISTANCE], encounter[HAZARDS], encounter[HIT] = np.inf, 0, 0
    encounter[AT_FAULT] = 0
    nearest, least = 0, np.inf
    for k in range(poses.shape[0]):
        box = poses[k]
        ahead = (objects_along[k] - along) % length
        if ahead < least:
            nearest, least = k, ahead
        gap = math.hypot(box[0] - state[0], box[1] - state[1])
        encounter[DISTANCE] = min(encounter[DISTANCE], gap)
        if gap < HAZARD and off_bow(state, box) < HAZARD_ANGLE:
            encounter[HAZARDS] += 1
        corners_of(state[0], state[1], state[2], own, corners)
        if body_touches(box, body, corners):
            encounter[HIT] += 1
            if ahead < length / 2.0:
                encounter[AT_FAULT] = 1
    encounter[NEXT] = nearest
    encounter[NEXT_SEEN] = body_in_view(state, lens, poses[nearest], body, corners)


@kernel
def meet(
    rows: np.ndarray, states: np.ndarray, along: np.ndarray, length: float, poses: np.ndarray,
    objects_along: np.ndarray, own: np.ndarray, body: np.ndarray, lens: np.ndarray,
    out: np.ndarray,
) -> None:  # fmt: skip
    """Measure the encounters of some cars with their objects: bots, or boxes.

    A car hits an object when one of its corners is inside the object's body, and is at fault when
    that object is less than half a lap ahead. The next is the first ahead, seen if `body_in_view`.

    Args:
        rows: which cars, (K,).
        states: base x, y (m) and heading (rad) first, (N, ≥3).
        along: arclength of the cars along the centre line, (N,), m.
        length: of the track, m.
        poses: `Objects.poses`, (N, B, 4).
        objects_along: `Objects.along`, (N, B), m.
        own: length and width of a car, (2,), m.
        body: the same of an object.
        lens: `camera.lens()`, (6,).
        out: filled with DISTANCE to the nearest object (m), number of HAZARDS and of objects HIT,
            AT_FAULT, which is NEXT, and NEXT_SEEN, (N, 6).
    """
    corners = np.empty((4, 2))
    for row in rows:
        meet_one(
            states[row], along[row], length, poses[row], objects_along[row], own, body, lens,
            corners, out[row],
        )  # fmt: skip
