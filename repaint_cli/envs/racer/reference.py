"""The kernels once more, in numpy that is slow and plain, for the tests to compare. SI units."""

from typing import Any

import numpy as np

from repaint_cli.envs.racer import boxes, camera, car, encounters, ground
from repaint_cli.envs.racer.track import Floats, Track


def line_project(line: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Find the line's points nearest to points (P, 2), (P, 2), and their positions, (P,)."""
    start, step = line[:-1], np.diff(line, axis=0)  # (M, 2)
    squared = (step**2).sum(axis=1)
    offset = points[:, None] - start  # (P, M, 2)
    share = np.clip((offset * step).sum(axis=2) / np.where(squared > 0, squared, 1), 0, 1)
    near = start + share[:, :, None] * step  # (P, M, 2)
    best = ((near - points[:, None]) ** 2).sum(axis=2).argmin(axis=1)
    rows = np.arange(len(points))
    return near[rows, best], best + share[rows, best]


def ring_winds(ring: Floats, points: Floats) -> Any:
    """Tell which points (P, 2) the ring winds around, (P,) bool, by summing the angles it spans."""
    arms = ring - points[:, None]  # (P, M, 2)
    a, b = arms[:, :-1], arms[:, 1:]
    cross = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return np.abs(np.arctan2(cross, (a * b).sum(axis=2)).sum(axis=1)) > np.pi


def crosses_itself(line: Floats) -> bool:
    """Tell whether two segments of a line properly cross, by solving for where."""
    ways = np.diff(line, axis=0)
    for i in range(len(ways)):
        for j in range(i + 2, len(ways)):
            matrix = np.stack([ways[i], -ways[j]], axis=1)
            if abs(np.linalg.det(matrix)) > 0:
                shares = np.linalg.solve(matrix, line[j] - line[i])
                if ((shares > 0) & (shares < 1)).all():
                    return True
    return False


def _on_road(track: Track, points: Floats) -> Any:
    """Tell which points (P, 2) are on the road, (P,) bool."""
    edge, hole = track.outline
    return ring_winds(edge, points) & ~ring_winds(hole, points)


def locate(track: Track, states: Floats) -> Floats:
    """Measure where cars (N, 5) stand, (N, 6), as `geometry.locate` tells it."""
    turn = _rotations(states[:, car.YAW])
    base = states[:, :2]
    front = base + turn @ np.array([car.FRONT_OFFSET, 0.0])
    wheels = (base[:, None] + np.einsum("nij,kj->nki", turn, car.WHEELS)).reshape(-1, 2)
    on_road = _on_road(track, wheels)
    centre, where = line_project(track.centre, front)
    inner, _ = line_project(track.inner, centre)
    outer, _ = line_project(track.outer, centre)
    along = np.interp(where, np.arange(len(track.distances)), track.distances)
    columns = [
        along / track.length,
        np.linalg.norm(centre - front, axis=1),
        np.linalg.norm(inner - front, axis=1),
        np.linalg.norm(outer - front, axis=1),
        np.linalg.norm(inner - outer, axis=1),
        on_road.reshape(-1, 4).sum(axis=1),
    ]
    return np.stack(columns, axis=1)


def bot_points(track: Track, along: Floats, sides: Floats) -> Floats:
    """Return where bots are, (N, B, 2), by arclength and side, each (N, B)."""

    def at(ring: Floats) -> Floats:
        columns = [np.interp(along, track.distances, ring[:, k]) for k in (0, 1)]
        return np.stack(columns, axis=-1)

    centre, inner, outer = at(track.centre), at(track.inner), at(track.outer)
    border = np.where(sides[..., None] > 0, inner, outer)
    points: Floats = centre + np.abs(sides)[..., None] / 2 * (border - centre)
    return points


def drive(
    states: Floats, before: Floats, commands: Floats, profile: car.CarProfile, seconds: float
) -> Floats:
    """Return the states (N, 5) of cars after one step; `car.drive` does it to one, in place."""
    x, y, yaw, speed, steering = states.T
    h = seconds / car.SUBSTEPS
    for i in range(car.SUBSTEPS):
        old = np.clip(profile.delay / h - i, 0, 1)
        wanted_steering, wanted_speed = (old * before + (1 - old) * commands).T
        if profile.speed_lag:
            limit = profile.acceleration_limit
            speed = speed + h * np.clip((wanted_speed - speed) / profile.speed_lag, -limit, limit)
        else:
            speed = wanted_speed
        steering = (
            steering + h * (wanted_steering - steering) / profile.steering_lag
            if profile.steering_lag
            else wanted_steering
        )
        bend, most = np.tan(steering) / profile.wheelbase, profile.curvature_limit
        bend = most * np.tanh(bend / most) if np.isfinite(most) else bend
        x = x + h * speed * (np.cos(yaw) - car.REAR_AXLE * bend * np.sin(yaw))
        y = y + h * speed * (np.sin(yaw) + car.REAR_AXLE * bend * np.cos(yaw))
        yaw = yaw + h * speed * bend
    return np.stack([x, y, np.arctan2(np.sin(yaw), np.cos(yaw)), speed, steering], axis=1)


def luma(track: Track, points: Floats) -> Floats:
    """Return the grey level of ground points (P, 2), (P,)."""
    on_road = _on_road(track, points)
    gaps = [_gap(ring, points) for ring in (track.inner, track.outer, track.centre)]
    _, where = line_project(track.centre, points)
    along = np.interp(where, np.arange(len(track.distances)), track.distances)
    levels = [
        ground.luma(min(a, b), c, s, on)
        for a, b, c, s, on in zip(*gaps, along, on_road, strict=True)
    ]
    return np.array(levels)


def render(state: Floats, picture: ground.Ground, eye_side: float = 0.0) -> Floats:
    """Return what the camera of a car (5,) sees, (120, 160), casting a ray through every pixel.

    The ray runs to the ground and to the planes of the four walls; what it meets first counts.
    """
    rays = _rays(state[car.YAW])  # (120, 160, 3)
    eye = _eye(state, eye_side)
    grey = np.full(rays.shape[:2], float(camera.SKY))
    nearest = np.full(rays.shape[:2], np.inf)
    with np.errstate(divide="ignore"):
        for wall, corner in enumerate((0, 2, 1, 3)):  # as WALLS: least x, greatest x, least y, …
            axis = corner % 2
            far = (picture.field[corner] - eye[axis]) / rays[..., axis]
            hit = (far > 0) & (far < nearest)
            nearest[hit] = far[hit]
            top = eye[2] + far * rays[..., 2] <= camera.WALL_HEIGHT
            grey = np.where(hit, np.where(top, camera.WALLS[wall], camera.SKY), grey)
        down = -eye[2] / rays[..., 2]
    for row, level in enumerate(camera.row_table()[:, camera.LEVEL].astype(int)):
        seen = (down[row] > 0) & (down[row] < nearest[row])
        points = eye[:2] + down[row, seen, None] * rays[row, seen, :2]
        grey[row, seen] = _bilinear(picture.levels[level], points - picture.origin, level)
    return grey


def draw_boxes(state: Floats, eye_side: float, poses: Floats, grey: Floats) -> Floats:
    """Return a picture (120, 160) with boxes (B, ≥3) in it: every pixel's nearest face."""
    rays = _rays(state[car.YAW])
    nearest, grey = np.full(rays.shape[:2], np.inf), grey.copy()
    for box in poses:
        far, level = _faces(box, _eye(state, eye_side), rays)
        closer = far < nearest
        nearest[closer], grey[closer] = far[closer], level[closer]
    return grey


def meet(state: Floats, along: float, length: float, poses: Floats, bots_along: Floats) -> Floats:
    """Return how a car (≥3,) stands to its bots (B, ≥3), (6,), as `encounters.meet` tells it."""
    half = np.array([encounters.BODY_LENGTH, encounters.BODY_WIDTH]) / 2
    outline = half * [[1, 1], [1, -1], [-1, -1], [-1, 1]]
    turns = _rotations(poses[:, 2])
    own = state[:2] + outline @ _rotations(state[2:3])[0].T  # (4, 2)
    ways = poses[:, :2] - state[:2]  # (B, 2)
    gaps = np.linalg.norm(ways, axis=1)
    bow = _rotations(state[2:3])[0][:, 0]
    angles = np.arccos(np.clip(ways @ bow / gaps, -1, 1))
    in_bots = np.abs(np.einsum("bkj,bji->bki", own - poses[:, None, :2], turns)) <= half
    hit = in_bots.all(axis=2).any(axis=1)
    ahead = np.mod(bots_along - along, length)
    after = int(ahead.argmin())
    bot = poses[after, :2] + np.vstack([[0, 0], outline]) @ turns[after].T
    hazards = (gaps < encounters.HAZARD) & (angles < encounters.HAZARD_ANGLE)
    at_fault = (hit & (ahead < length / 2)).any()
    seen = _in_picture(state, bot).any()
    return np.array([gaps.min(), hazards.sum(), hit.sum(), at_fault, after, seen], dtype=float)


def _in_picture(state: Floats, points: Floats) -> Any:
    """Tell which ground points (P, 2) have a pixel, (P,) bool."""
    eye = _eye(state, 0.0)
    ways = np.column_stack([points - eye[:2], np.full(len(points), -eye[2])])
    ways[:, :2] = ways[:, :2] @ _rotations(state[2:3])[0]  # ahead, left, up
    cos, sin = np.cos(camera.PITCH), np.sin(camera.PITCH)
    depth = ways @ [cos, 0, -sin]
    with np.errstate(divide="ignore", invalid="ignore"):
        column = camera.WIDTH / 2 - camera.FOCAL * ways[:, 1] / depth
        row = camera.HEIGHT / 2 - camera.FOCAL * (ways @ [sin, 0, cos]) / depth
    inside = (column >= 0) & (column <= camera.WIDTH) & (row >= 0) & (row <= camera.HEIGHT)
    return inside & (depth >= encounters.NEAR) & (depth <= encounters.FAR)


def scan(state: Floats, poses: Floats) -> Floats:
    """Return what a lidar reads, (64,), without noise, by walking 0.1 mm steps along each beam."""
    angles = state[2] + np.pi + boxes.FIRST_BEAM + boxes.BEAM_SPAN * np.arange(64) / 63
    start = state[:2] + _rotations(state[2:3])[0] @ [boxes.BEAM_X, 0]
    steps = np.arange(0, boxes.RANGE, 1e-4)
    points = start + steps[:, None, None] * np.stack([np.cos(angles), np.sin(angles)], -1)
    inside = np.zeros(points.shape[:2], bool)
    for x, y, yaw in poses[:, :3]:
        own = (points - [x, y]) @ _rotations(np.array([yaw]))[0]
        inside |= (np.abs(own) <= [boxes.LENGTH / 2, boxes.WIDTH / 2]).all(-1)
    ranges: Floats = np.where(inside.any(0), steps[inside.argmax(0)], boxes.RANGE)
    return ranges


def _faces(box: Floats, eye: Floats, rays: Floats) -> tuple[Floats, Floats]:
    """Return how far along each ray (120, 160, 3) a box's first face is, and its grey level."""
    turn = _rotations(box[2:3])[0]
    half = np.array([boxes.LENGTH, boxes.WIDTH, boxes.HEIGHT]) / 2
    at = np.append((eye[:2] - box[:2]) @ turn, eye[2] - half[2])
    way = np.concatenate([rays[..., :2] @ turn, rays[..., 2:]], axis=-1)
    nearest, grey = np.full(rays.shape[:2], np.inf), np.zeros(rays.shape[:2])
    for axis, level in enumerate((boxes.END, boxes.FLANK, np.nan)):
        others = [k for k in range(3) if k != axis]
        for plane in (-half[axis], half[axis]):
            with np.errstate(divide="ignore", invalid="ignore"):
                far = (plane - at[axis]) / way[..., axis]
                inside = np.abs(at + far[..., None] * way)[..., others] <= half[others]
            hit = (far > 0) & inside.all(-1) & (far < nearest)
            nearest[hit], grey[hit] = far[hit], level
    return nearest, grey


def _eye(state: Floats, eye_side: float) -> Floats:
    place = state[:2] + _rotations(state[2:3])[0] @ [camera.CAMERA_X, eye_side]
    return np.append(place, camera.CAMERA_Z)


def _rotations(yaw: Floats) -> Floats:
    """Return the matrices (N, 2, 2) from the frames of cars with headings (N,) to the world's."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.stack([np.stack([cos, -sin], -1), np.stack([sin, cos], -1)], -2)


def _gap(ring: Floats, points: Floats) -> Floats:
    gaps: Floats = np.linalg.norm(line_project(ring, points)[0] - points, axis=1)
    return gaps


def _rays(yaw: float) -> Floats:
    """Return the directions of all pixels in the world, (120, 160, 3)."""
    right = (np.arange(camera.WIDTH) + 0.5 - camera.WIDTH / 2) / camera.FOCAL
    down = (np.arange(camera.HEIGHT) + 0.5 - camera.HEIGHT / 2) / camera.FOCAL
    cos, sin = np.cos(camera.PITCH), np.sin(camera.PITCH)
    axis, below = np.array([cos, 0, -sin]), np.array([-sin, 0, -cos])  # in the car's frame
    rays: Floats = (
        axis + down[:, None, None] * below + right[None, :, None] * np.array([0, -1.0, 0])
    )
    rays[..., :2] = rays[..., :2] @ _rotations(np.array([yaw]))[0].T
    return rays


def _bilinear(level: Any, offsets: Floats, number: int) -> Floats:
    """Look up a level of the ground at offsets (P, 2) from its corner, m."""
    u, v = (offsets / (ground.TEXEL * 2**number) - 0.5).T
    c, r = np.floor(u).astype(int), np.floor(v).astype(int)
    fu, fv = u - c, v - r
    low = level[r, c] * (1 - fu) + level[r, c + 1] * fu
    high = level[r + 1, c] * (1 - fu) + level[r + 1, c + 1] * fu
    grey: Floats = low * (1 - fv) + high * fv
    return grey
