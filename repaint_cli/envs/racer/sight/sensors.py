"""What the cars see: one camera or two, and a lidar that looks back. SI units."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from repaint_cli.envs.racer.dynamics.directions import Rows, several
from repaint_cli.envs.racer.dynamics.fleet import Fleet
from repaint_cli.envs.racer.dynamics.objects import ObjectSettings
from repaint_cli.envs.racer.names import BEAMS
from repaint_cli.envs.racer.sight import boxes
from repaint_cli.envs.racer.sight.appearance import RandomAppearance
from repaint_cli.envs.racer.sight.camera import (
    EYE_OFFSETS,
    HEIGHT,
    STEREO_EYE_OFFSETS,
    WALLS,
    WIDTH,
    lens,
    render_rows,
    row_table,
)
from repaint_cli.envs.racer.sight.ground import ground_of
from repaint_cli.envs.racer.sight.noise import Noise, disturb_image
from repaint_cli.envs.racer.track.geometry import Floats
from repaint_cli.envs.racer.track.track import Track

SENSORS = ("camera", "camera+lidar", "stereo", "stereo+lidar")
RANGE_NOISE = 0.01
"""Standard deviation of a lidar's reading below its range, m."""

Readings = dict[str, NDArray[np.uint8] | NDArray[np.float32]]
"""By sensor: "camera" (N, 120, 160, 1 or 2) uint8 and perhaps "lidar" (N, 64) float32, m."""


def body_of(settings: ObjectSettings) -> Floats:
    """Return an object's size (m) and grey levels, (5,), as `boxes` has them."""
    if not settings.boxes:
        return boxes.BOT
    return np.array([*settings.box_size, boxes.CARTON_END_LUMA, boxes.CARTON_SIDE_LUMA])


class Sensors:
    """The sensors of all cars of a fleet."""

    def __init__(
        self, track: Track | Sequence[Track], kind: str, range_min: float, noise: Noise | None,
        threads: int, appearance: RandomAppearance | None = None,
    ) -> None:  # fmt: skip
        """Build them.

        Args:
            track: that the cars drive, one or several.
            kind: one of `SENSORS`.
            range_min: the lidar's least reading, m.
            noise: disturbances of the images, or None.
            threads: that share the cars.
            appearance: what is drawn for each episode, or None.
        """
        self.eye_offsets = EYE_OFFSETS if kind.startswith("camera") else STEREO_EYE_OFFSETS
        """From the car's middle to the left, of each camera, m."""
        self.has_lidar = kind.endswith("lidar")
        """Whether there is one."""
        self.range_min = range_min
        """What the lidar reads of anything nearer, m."""
        grounds = [ground_of(road) for road in several(track)]
        self.grounds = [(row_table(), g.levels, g.origin, g.field, WALLS) for g in grounds]
        """What `camera.render` reads of each track."""
        self._lens = lens()
        self.noise = noise
        """Disturbances of the images, or None."""
        self.appearance = appearance
        """What is drawn for each episode, or None."""
        self._tables = dict[int, NDArray[np.uint8]]()  # what grey levels become, by car
        self._threads = threads
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def space(self) -> spaces.Box | spaces.Dict:
        """Return the space of one car's observations: an image, or with a lidar both by name."""
        camera = spaces.Box(0, 255, (HEIGHT, WIDTH, len(self.eye_offsets)), np.uint8)
        if not self.has_lidar:
            return camera
        lidar = spaces.Box(self.range_min, boxes.RANGE, (BEAMS,), np.float32)
        return spaces.Dict({"camera": camera, "lidar": lidar})

    def start(self, rows: Rows, rngs: Sequence[np.random.Generator]) -> None:
        """Draw how the track looks in new episodes of these cars (K,), if that is random."""
        if self.appearance is not None:
            self._tables |= {row: self.appearance.table(rngs[row]) for row in rows.tolist()}

    def read(self, rows: Rows, fleet: Fleet, rngs: Sequence[np.random.Generator]) -> Readings:
        """Return the readings of these cars (K,) in new arrays (N, …), not filled for others."""
        n = len(fleet.states)
        images = np.empty((n, HEIGHT, WIDTH, len(self.eye_offsets)), np.uint8)
        ranges = np.empty((n, BEAMS), np.float32)

        def read_part(part: Rows) -> None:
            self._draw(part, fleet, rngs, images)
            if self.has_lidar:
                self._scan(part, fleet, rngs, ranges)

        if self._pool is None:
            read_part(rows)
        else:
            list(self._pool.map(read_part, np.array_split(rows, self._threads)))
        return {"camera": images, "lidar": ranges} if self.has_lidar else {"camera": images}

    def close(self) -> None:
        """Stop the threads."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def _draw(
        self,
        rows: Rows,
        fleet: Fleet,
        rngs: Sequence[np.random.Generator],
        images: NDArray[np.uint8],
    ) -> None:
        for channel, offset in enumerate(self.eye_offsets):
            for track, own in fleet.directions.by_track(rows):
                render_rows(own, fleet.states, offset, *self.grounds[track], images, channel)
            if fleet.objects is not None:
                boxes.draw_rows(
                    rows, fleet.states, fleet.objects.poses, body_of(fleet.objects.settings),
                    offset, self._lens, images, channel,
                )  # fmt: skip
            if self.appearance is not None:
                for row in rows.tolist():
                    images[row, :, :, channel] = self._tables[row][images[row, :, :, channel]]
            if self.noise is not None:
                for row in rows:
                    image = images[row, :, :, channel]
                    image[:] = disturb_image(image, self.noise, rngs[row])

    def _scan(
        self,
        rows: Rows,
        fleet: Fleet,
        rngs: Sequence[np.random.Generator],
        ranges: NDArray[np.float32],
    ) -> None:
        exact = np.full((len(fleet.states), BEAMS), boxes.RANGE)
        if fleet.objects is not None:
            body = body_of(fleet.objects.settings)
            boxes.scan_rows(rows, fleet.states, fleet.objects.poses, body, exact)
        for row in rows:
            noise = RANGE_NOISE * rngs[row].standard_normal(BEAMS)
            noisy = np.where(exact[row] < boxes.RANGE, exact[row] + noise, boxes.RANGE)
            ranges[row] = np.clip(noisy, self.range_min, boxes.RANGE)
