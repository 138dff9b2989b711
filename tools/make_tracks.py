"""Draw the shipped tracks: closed cubic splines, with borders at half the width on each side.

    python tools/make_tracks.py [folder]

writes one array (N, 6) a track: centre x, y, inner x, y, outer x, y in metres, the first row again
at the end.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

SPACING = 0.12
"""Between rows, m."""


@dataclass(frozen=True)
class Shape:
    """A track's design: control points in driving order, scaled to a length."""

    points: list[tuple[float, float]]
    length: float
    """Of the centre line, m."""
    width: float
    """Of the road, m."""
    smoothing: float = 0.0
    """Radius of averaging along the line, m: it rounds what the spline bends too sharply."""


SHAPES = {
    "reinvent-like": Shape(
        [(0.8, 0.1), (2.4, -0.1), (4.2, 0.3), (6.0, 0.0), (7.2, 0.7), (7.0, 1.9), (5.7, 2.3),
         (5.0, 3.2), (4.1, 4.2), (2.9, 3.9), (2.5, 2.8), (1.5, 2.3),
         (0.0, 2.6), (-0.9, 1.8), (-0.4, 0.7)],
        length=17.7, width=0.762, smoothing=0.22,
    ),
    "wide-loop": Shape(
        [(0.0, 0.0), (3.0, -0.6), (6.2, -0.2), (8.0, 1.4), (7.2, 3.6), (5.2, 3.4), (3.8, 4.2),
         (2.4, 5.8), (0.2, 5.4), (-0.4, 3.6), (-1.4, 1.8)],
        length=23.0, width=1.067, smoothing=0.3,
    ),
    "oval": Shape(
        [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0), (4.0, 0.0), (4.87, 0.5), (4.87, 1.5),
         (4.0, 2.0), (3.0, 2.0), (2.0, 2.0), (1.0, 2.0), (0.0, 2.0), (-0.87, 1.5), (-0.87, 0.5)],
        length=12.0, width=0.762, smoothing=0.25,
    ),
}  # fmt: skip


def draw(shape: Shape) -> np.ndarray:
    """Return the waypoints of a shape, (N, 6), m; driven with the infield on the left."""
    line = spline(np.array(shape.points), 400)
    line = smoothed(evenly(line, 2000), shape)
    for _ in range(3):  # a polyline is a little shorter than its curve
        line = line * (shape.length / length_of(line))
    count = round(shape.length / SPACING)
    line = evenly(line, count)
    line *= shape.length / length_of(line)
    ahead = np.roll(line[:-1], -1, axis=0) - np.roll(line[:-1], 1, axis=0)
    left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    left /= np.hypot(*left.T)[:, None]
    left = np.concatenate([left, left[:1]])
    half = shape.width / 2
    rows = np.concatenate([line, line + half * left, line - half * left], axis=1)
    corner = rows[:, 4:].min(axis=0)
    rows = rows - np.tile(corner, 3)
    rows[-1] = rows[0]
    return rows


def spline(points: np.ndarray, count: int) -> np.ndarray:
    """Return the closed cubic spline through points (K, 2) as a polyline (K·count + 1, 2).

    Knots lie √chord apart (centripetal), which keeps uneven points from making loops. With gaps hᵢ
    the curve's second derivatives Mᵢ at the knots solve hᵢ₋₁·Mᵢ₋₁ + 2(hᵢ₋₁ + hᵢ)·Mᵢ + hᵢ·Mᵢ₊₁ =
    6(slopeᵢ − slopeᵢ₋₁), cyclically.
    """
    after = np.roll(points, -1, axis=0)
    gap = np.sqrt(np.hypot(*(after - points).T))  # (K,)
    slope = (after - points) / gap[:, None]  # (K, 2)
    gap_before = np.roll(gap, 1)
    one = np.eye(len(points))
    system = 2 * np.diag(gap_before + gap)
    system += gap_before[:, None] * np.roll(one, -1, axis=1)
    system += gap[:, None] * np.roll(one, 1, axis=1)
    bend = np.linalg.solve(system, 6 * (slope - np.roll(slope, 1, axis=0)))  # (K, 2)
    bend_after = np.roll(bend, -1, axis=0)
    b = np.arange(count)[:, None, None] / count  # share of the way, (count, 1, 1)
    a, square = 1 - b, (gap**2)[:, None] / 6
    line = a * points + b * after + square * ((a**3 - a) * bend + (b**3 - b) * bend_after)
    line = line.transpose(1, 0, 2).reshape(-1, 2)
    return np.concatenate([line, line[:1]])


def length_of(line: np.ndarray) -> float:
    """Return the length of a polyline (M, 2), m."""
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def evenly(line: np.ndarray, count: int) -> np.ndarray:
    """Return `count` segments of equal arclength along a polyline, (count + 1, 2)."""
    along = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    where = np.linspace(0, along[-1], count + 1)
    return np.stack([np.interp(where, along, line[:, k]) for k in (0, 1)], axis=1)


def smoothed(line: np.ndarray, shape: Shape) -> np.ndarray:
    """Average a closed polyline with a Gaussian along its length."""
    if shape.smoothing == 0:
        return line
    ring = line[:-1]
    frequency = np.fft.fftfreq(len(ring), d=1 / len(ring))
    sigma = shape.smoothing / length_of(line)  # in laps
    keep = np.exp(-0.5 * (2 * np.pi * frequency * sigma) ** 2)
    ring = np.fft.ifft(np.fft.fft(ring, axis=0) * keep[:, None], axis=0).real
    return np.concatenate([ring, ring[:1]])


def radii(line: np.ndarray) -> np.ndarray:
    """Return the radius of curvature at each point, m; negative where it bends to the right."""
    ring = line[:-1]
    a, b, c = np.roll(ring, 1, axis=0), ring, np.roll(ring, -1, axis=0)
    (ux, uy), (vx, vy) = (b - a).T, (c - b).T
    sides = np.hypot(ux, uy) * np.hypot(vx, vy) * np.hypot(*(c - a).T)
    return sides / (2 * (ux * vy - uy * vx))


def main() -> None:
    """Write every track and say what it is like."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "tasks/racer/tracks")
    folder.mkdir(parents=True, exist_ok=True)
    for name, shape in SHAPES.items():
        rows = draw(shape)
        np.save(folder / f"{name}.npy", rows)
        bends = radii(rows[:, :2])
        left, right = bends[bends > 0].min(), -bends[bends < 0].max(initial=-np.inf)
        size = rows[:, 4:].max(axis=0)
        print(
            f"{name}: {len(rows)} rows, {length_of(rows[:, :2]):.3f} m, "
            f"{size[0]:.2f} × {size[1]:.2f} m, least radius left {left:.2f}, right {right:.2f} m"
        )


if __name__ == "__main__":
    main()
