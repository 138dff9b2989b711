"""What the cars on a GPU see: one camera or two, and a lidar that looks back. SI units."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.device import launch_sight
from repaint_cli.envs.racer.device.arrays import launch, launch_each, upload, zeros
from repaint_cli.envs.racer.device.fleet import DeviceFleet
from repaint_cli.envs.racer.names import BEAMS
from repaint_cli.envs.racer.sight.boxes import BOT, VIEW
from repaint_cli.envs.racer.sight.camera import HEIGHT, WIDTH, lens
from repaint_cli.envs.racer.sight.sensors import RANGE_NOISE, Sensors, body_of

LANES, ROWS = 32, 4
"""Threads of a block of the camera: LANES along each of ROWS rows of pixels."""


class DeviceSensors:
    """The sensors of all cars of a fleet on a GPU."""

    def __init__(self, like: Sensors, fleet: DeviceFleet) -> None:
        """Build them with the settings of sensors on the CPU."""
        table, levels, origin, field, walls = like.grounds[0]
        pictures = tuple(upload(level) for level in levels)
        self._ground = upload(table), pictures, upload(origin), upload(field), upload(walls)
        self._lens = upload(lens())
        objects = fleet.objects
        self._n_objects = objects.settings.n if objects else 0
        self._body = upload(body_of(objects.settings) if objects else BOT)
        self._views = zeros((fleet.n if objects else 0, self._n_objects, VIEW))
        self._eye_offsets, self._least = like.eye_offsets, like.range_min
        self.range_noise = RANGE_NOISE
        """Standard deviation of a lidar's reading below its range, m."""
        self._keys = zeros((fleet.n,), np.uint64)
        self.images = zeros((fleet.n, HEIGHT, WIDTH, len(self._eye_offsets)), np.uint8)
        """Where pictures are drawn, (N, 120, 160, C); another array may take its place."""
        self.ranges = zeros((fleet.n, BEAMS), np.float32) if like.has_lidar else None
        """What the lidar reads, (N, 64), m, or None."""

    def begin(self, keys: NDArray[np.uint64], stream: Any) -> None:
        """Set where the noise of each car's lidar comes from, (N,)."""
        self._keys.copy_to_device(keys, stream)

    def read(self, fleet: DeviceFleet, stream: Any) -> None:
        """Draw the pictures and read the lidars of all cars; those of parked ones stay."""
        for channel, offset in enumerate(self._eye_offsets):
            if self._n_objects:
                launch_each(
                    launch_sight.view_boxes, fleet.n * self._n_objects, stream, offset,
                    self._body, self._lens, fleet.states, fleet.poses, self._views,
                )  # fmt: skip
            launch(
                launch_sight.draw_pictures, (fleet.n, -(-HEIGHT // ROWS)), (LANES, ROWS), stream,
                offset, *self._ground, self._lens, self._body, self._n_objects, fleet.states,
                self._views, self.images, channel,
            )  # fmt: skip
        if self.ranges is not None:
            launch(
                launch_sight.scan_ranges, fleet.n, BEAMS, stream, self._n_objects, self._body,
                self.range_noise, self._least, self._keys, fleet.readings, fleet.states,
                fleet.poses, self.ranges,
            )  # fmt: skip
