"""What a GPU runs to draw pictures and to scan: it calls the kernels of the CPU.

There is no arithmetic of the simulator here, and every pixel and range is written by one thread.
**N** cars, **B** bots or boxes.
"""

from typing import Any

from numba import cuda, float64

from repaint_cli.envs.racer.device.noise import normal
from repaint_cli.envs.racer.dynamics.car import YAW
from repaint_cli.envs.racer.sight.boxes import (
    BOTTOM,
    FIRST,
    RANGE,
    TOP,
    beam,
    beam_angle,
    draw_box_row,
    in_reach,
    lidar_at,
    rank_of,
    view_box,
)
from repaint_cli.envs.racer.sight.camera import (
    HEIGHT,
    LEVEL,
    SKY,
    SKYWARD,
    WIDTH,
    eye_at,
    ground_luma,
    row_at,
    texels_at,
    wall_luma,
)
from repaint_cli.kernels import device_kernel


@device_kernel
def view_boxes(eye_offset: Any, body: Any, lens: Any, states: Any, poses: Any, views: Any) -> None:
    """Fill how each car's eye sees its boxes, (N, B, 8), in the order in which they are drawn."""
    k, n_boxes = cuda.grid(1), poses.shape[1]
    if k < poses.shape[0] * n_boxes:
        row, b = k // n_boxes, k % n_boxes
        rank = rank_of(states[row], poses[row], b)
        view_box(
            states[row], eye_offset, poses[row, b], body, lens, (HEIGHT, WIDTH), views[row, rank]
        )


@device_kernel
def draw_pictures(
    eye_offset: Any, table: Any, levels: Any, origin: Any, field: Any, walls: Any, lens: Any,
    body: Any, n_boxes: Any, states: Any, views: Any, images: Any, channel: Any,
) -> None:  # fmt: skip
    """Draw a channel of the pictures: a row of threads draws a row of pixels, a column a lane."""
    row, lane, stride = cuda.blockIdx.x, cuda.threadIdx.x, cuda.blockDim.x
    r = cuda.blockIdx.y * cuda.blockDim.y + cuda.threadIdx.y
    eyes = cuda.shared.array(4, float64)
    if lane == 0 and cuda.threadIdx.y == 0:
        eyes[0], eyes[1], eyes[2], eyes[3] = eye_at(states[row], eye_offset)
    cuda.syncthreads()
    if r >= HEIGHT:
        return
    line, look = images[row, r, :, channel], table[r]
    eye_x, eye_y, level = eyes[2], eyes[3], levels[int(look[LEVEL])]
    x, y, dx, dy, first, end = row_at(states[row], eye_offset, eyes[0], eyes[1], look, field)
    u, v, du, dv = texels_at(x, y, dx, dy, look, origin)
    for k in range(lane, WIDTH, stride):
        if k < first or k >= end:
            line[k] = wall_luma(eye_x, eye_y, x + k * dx - eye_x, y + k * dy - eye_y, field, walls)
        elif look[SKYWARD] > 0.0:
            line[k] = SKY
        else:
            line[k] = ground_luma(k, u, v, du, dv, level)
    for rank in range(n_boxes):
        view = views[row, rank]
        if view[TOP] <= r and r < view[BOTTOM]:
            first = int(view[FIRST])
            first += (lane - first) % stride
            draw_box_row(r, HEIGHT, WIDTH, view, body, lens, first, stride, line)


@device_kernel
def scan_ranges(
    n_objects: Any, body: Any, noise: Any, least: Any, keys: Any, readings: Any, states: Any,
    poses: Any, ranges: Any,
) -> None:  # fmt: skip
    """Measure a lidar's ranges (N, beams), a block a car and a thread a beam, with noise (m)."""
    row, k, beams = cuda.blockIdx.x, cuda.threadIdx.x, ranges.shape[1]
    near = RANGE
    x, y = lidar_at(states[row])
    for b in range(n_objects):
        box = poses[row, b]
        if in_reach(x, y, box, body):
            near = min(near, beam(x, y, beam_angle(states[row, YAW], k, beams), box, body))
    if near < RANGE and noise > 0.0:
        near += noise * normal(keys[row], readings[row] * beams + k)
    ranges[row, k] = min(max(near, least), RANGE)
