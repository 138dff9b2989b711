"""Geometry of polylines, and of a car between them; loops over points are compiled. Metres.

A line is (M, 2); a ring is a line whose last row repeats its first.
"""

import math

import numpy as np
from numpy.typing import NDArray

from repaint_cli.kernels import kernel

Floats = NDArray[np.float64]

NDIST, CENTRE_GAP, INNER_GAP, OUTER_GAP, ROAD_WIDTH, WHEELS_ON = range(6)
"""Columns of the output of `locate`."""


def signed_area(ring: Floats) -> float:
    """Return the shoelace area, m²; positive for counter-clockwise rings."""
    x, y = ring[:-1].T
    x_next, y_next = ring[1:].T
    return float(np.sum(x * y_next - x_next * y) / 2)


def road_ring(outer: Floats, inner: Floats) -> Floats:
    """Return the ring along the outer border of an open track and back along the inner one."""
    return np.concatenate([outer, inner[::-1], outer[:1]])


@kernel
def line_project(line: np.ndarray, x: float, y: float) -> tuple[float, float, float]:
    """Return the line's point nearest to (x, y); ties go to the earlier segment.

    Returns:
        the point's x and y, and its position i + share: `share` of the way along segment i.
    """
    best = np.inf
    near_x, near_y, where = line[0, 0], line[0, 1], 0.0
    for i in range(len(line) - 1):
        ax, ay = line[i, 0], line[i, 1]
        dx, dy = line[i + 1, 0] - ax, line[i + 1, 1] - ay
        squared = dx * dx + dy * dy
        share = 0.0
        if squared > 0.0:  # a border may hold a point twice at a sharp bend
            share = min(max(((x - ax) * dx + (y - ay) * dy) / squared, 0.0), 1.0)
        px, py = ax + share * dx, ay + share * dy
        gap = (px - x) ** 2 + (py - y) ** 2
        if gap < best:
            best, near_x, near_y, where = gap, px, py, i + share
    return near_x, near_y, where


@kernel
def ring_holds(ring: np.ndarray, x: float, y: float) -> bool:
    """Tell whether (x, y) is inside the ring: an eastward ray crosses it an odd number of times."""
    inside = False
    for i in range(len(ring) - 1):
        ax, ay, bx, by = ring[i, 0], ring[i, 1], ring[i + 1, 0], ring[i + 1, 1]
        if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
            inside = not inside
    return inside


@kernel
def segments_cross(line: np.ndarray, i: int, j: int) -> bool:
    """Tell whether segments i and j of a line properly cross each other."""
    ax, ay, bx, by = line[i, 0], line[i, 1], line[i + 1, 0], line[i + 1, 1]
    cx, cy, dx, dy = line[j, 0], line[j, 1], line[j + 1, 0], line[j + 1, 1]
    c_side = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    d_side = (bx - ax) * (dy - ay) - (by - ay) * (dx - ax)
    a_side = (dx - cx) * (ay - cy) - (dy - cy) * (ax - cx)
    b_side = (dx - cx) * (by - cy) - (dy - cy) * (bx - cx)
    return bool(c_side * d_side < 0.0 and a_side * b_side < 0.0)


@kernel
def crossings(line: np.ndarray, pairs: np.ndarray) -> int:
    """Find pairs of segments of a line that properly cross each other.

    Args:
        line: (M, 2), m.
        pairs: filled with the numbers i < j of their segments, in that order, (C, 2); at most C are
            found.

    Returns:
        how many were found.
    """
    m, n = len(line) - 1, 0
    for i in range(m):
        for j in range(i + 2, m):
            if segments_cross(line, i, j):
                if n == len(pairs):
                    return n
                pairs[n, 0], pairs[n, 1] = i, j
                n += 1
    return n


@kernel
def nearest_of(places: np.ndarray, along: float) -> int:
    """Return the index of the arclength nearest to `along` (m) in places (W,), in their order.

    Of two in one place it is the nearer by index, as in DeepRacer.
    """
    after = min(max(int(np.searchsorted(places, along, side="right")), 1), len(places) - 1)
    return after - 1 if along - places[after - 1] <= places[after] - along else after


@kernel
def nearest_rows(places: np.ndarray, along: np.ndarray, nearest: np.ndarray) -> None:
    """Fill the indices that are `nearest_of` of arclengths, (K,) each."""
    for k in range(len(along)):
        nearest[k] = nearest_of(places, along[k])


@kernel
def locate(
    centre: np.ndarray, distances: np.ndarray, inner: np.ndarray, outer: np.ndarray,
    edge: np.ndarray, hole: np.ndarray, front: np.ndarray, wheels: np.ndarray, out: np.ndarray,
) -> None:  # fmt: skip
    """Measure where one car stands on the road.

    The border distances are those of DeepRacer: from the front point to the border points that are
    nearest to its projection on the centre line. On a bend this differs a little from the nearest
    border points of the car itself.

    Args:
        centre: centre line, (M, 2), m.
        distances: arclength at each centre point, (M,), m.
        inner: inner border, (M, 2), m.
        outer: outer border, (M, 2), m.
        edge: ring around the road, (M, 2), m.
        hole: ring around what is inside of it but not road, (M, 2), m.
        front: the car's front point, (2,), m.
        wheels: its wheel points, (4, 2), m.
        out: filled with lap fraction, distances to centre line, inner and outer border (m), road
            width (m) and the number of wheels on the road, (6,).
    """
    x, y = front[0], front[1]
    cx, cy, where = line_project(centre, x, y)
    i = min(int(where), len(centre) - 2)
    along = distances[i] + (where - i) * (distances[i + 1] - distances[i])
    ix, iy, _ = line_project(inner, cx, cy)
    ox, oy, _ = line_project(outer, cx, cy)
    out[NDIST] = along / distances[-1]
    out[CENTRE_GAP] = math.sqrt((cx - x) ** 2 + (cy - y) ** 2)
    out[INNER_GAP] = math.sqrt((ix - x) ** 2 + (iy - y) ** 2)
    out[OUTER_GAP] = math.sqrt((ox - x) ** 2 + (oy - y) ** 2)
    out[ROAD_WIDTH] = math.sqrt((ox - ix) ** 2 + (oy - iy) ** 2)
    on = 0
    for k in range(len(wheels)):
        wx, wy = wheels[k, 0], wheels[k, 1]
        if ring_holds(edge, wx, wy) and not ring_holds(hole, wx, wy):
            on += 1
    out[WHEELS_ON] = on


@kernel
def measure_one(
    state: np.ndarray, car_points: np.ndarray, centre: np.ndarray, distances: np.ndarray,
    inner: np.ndarray, outer: np.ndarray, edge: np.ndarray, hole: np.ndarray, room: np.ndarray,
    front: np.ndarray, out: np.ndarray,
) -> None:  # fmt: skip
    """Measure where one car stands; `room` (5, 2) is to work in, the rest is as in `measure`."""
    cos, sin = np.cos(state[2]), np.sin(state[2])
    for k in range(len(car_points)):
        room[k, 0] = state[0] + car_points[k, 0] * cos - car_points[k, 1] * sin
        room[k, 1] = state[1] + car_points[k, 0] * sin + car_points[k, 1] * cos
    front[0], front[1] = room[0, 0], room[0, 1]
    locate(centre, distances, inner, outer, edge, hole, room[0], room[1:], out)


@kernel
def measure(
    rows: np.ndarray,
    states: np.ndarray,
    car_points: np.ndarray,
    centre: np.ndarray,
    distances: np.ndarray,
    inner: np.ndarray,
    outer: np.ndarray,
    edge: np.ndarray,
    hole: np.ndarray,
    fronts: np.ndarray,
    measures: np.ndarray,
) -> None:
    """Measure where some cars stand on the road.

    Args:
        rows: which cars, (K,).
        states: base x, y (m) and heading (rad) first, (N, ≥3).
        car_points: front point and wheel points in the car's frame, (5, 2), m.
        centre: as in `locate`, like the next five.
        distances: arclength.
        inner: inner border.
        outer: outer border.
        edge: around the road.
        hole: inside of it.
        fronts: filled with the front points, (N, 2), m.
        measures: filled with the outputs of `locate`, (N, 6).
    """
    room = np.empty(car_points.shape)
    for row in rows:
        measure_one(
            states[row], car_points, centre, distances, inner, outer, edge, hole, room,
            fronts[row], measures[row],
        )  # fmt: skip
