"""All cars of an environment on one GPU: what `RacerVectorEnv` does there."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.racer.device.arrays import finish, given, stream_at
from repaint_cli.envs.racer.device.card import check_memory
from repaint_cli.envs.racer.device.fleet import DeviceFleet
from repaint_cli.envs.racer.device.sensors import DeviceSensors
from repaint_cli.envs.racer.device.starts import AHEAD
from repaint_cli.envs.racer.dynamics.commands import Commands, ListedCommands
from repaint_cli.envs.racer.dynamics.fleet import Fleet
from repaint_cli.envs.racer.dynamics.objects import WAITS
from repaint_cli.envs.racer.sight.camera import HEIGHT, WIDTH
from repaint_cli.envs.racer.sight.sensors import Sensors
from repaint_cli.envs.racer.track.geometry import Floats


class DeviceRacer:
    """Cars, their objects and their sensors on a GPU, where episodes begin and end by themselves.

    A step waits for nothing, and the arrays that it returns are overwritten by the next one. They
    are read in the order of `use_stream`'s stream, over `__cuda_array_interface__`.
    """

    def __init__(self, fleet: Fleet, sensors: Sensors, commands: Commands, parks: bool) -> None:
        """Make them with the settings of a fleet and of sensors on the CPU.

        Raises:
            DeviceError: the GPU is too small.
        """
        check_memory(bytes_for(fleet, sensors), len(fleet.states))
        self.fleet = DeviceFleet(fleet, commands)
        self.sensors = DeviceSensors(sensors, self.fleet)
        self._parks, self._commands = parks, commands
        self.stream = stream_at(0)
        """On which all of it happens."""
        finish()

    def use_stream(self, pointer: int) -> None:
        """Go on in another stream, such as `torch.cuda.current_stream().cuda_stream`."""
        self.stream = stream_at(pointer)

    def draw_into(self, images: Any) -> None:
        """Draw the pictures from now on into an array on the GPU, (N, 120, 160, C) uint8.

        Raises:
            ValueError: it has another shape or type.
        """
        images, own = given(images, self.stream), self.sensors.images
        if images.shape != own.shape or images.dtype != np.uint8:
            raise ValueError(
                f"expected an array {own.shape} of uint8 for the pictures, found {images.shape} "
                f"of {images.dtype}"
            )
        self.sensors.images = images

    def reset(
        self, rngs: Sequence[np.random.Generator], fractions: Floats | None,
        reverse: NDArray[np.bool_], parked: NDArray[np.bool_],
    ) -> tuple[Any, dict[str, Any]]:  # fmt: skip
        """Start an episode of every car; see `RacerVectorEnv.reset` and `DeviceFleet.begin`."""
        if self.sensors.ranges is not None:
            states = (rng.bit_generator.state["state"]["state"] for rng in rngs)
            keys = np.array([state % 2**64 for state in states], np.uint64)
            self.sensors.begin(keys, self.stream)
        self.fleet.begin(rngs, fractions, reverse, parked, self.stream)
        self.sensors.read(self.fleet, self.stream)
        return self._observation(), dict(self.fleet.infos)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Drive every car for 1/15 s; see `RacerVectorEnv.step`, with all arrays on the GPU.

        Listed actions beyond the list are not noticed, as that would take a look at them: they
        count as the nearest one.

        Raises:
            ValueError: the actions are not N of the action space.
        """
        actions, fleet = given(actions, self.stream), self.fleet
        listed = isinstance(self._commands, ListedCommands)
        shape, kinds = ((fleet.n,), "iu") if listed else ((fleet.n, 2), "f")
        if tuple(actions.shape) != shape or actions.dtype.kind not in kinds:
            raise ValueError(
                f"expected {'integer actions' if listed else 'pairs of actions'} {shape}, found "
                f"{tuple(actions.shape)} of {actions.dtype}"
            )
        fleet.step(actions, self._parks, self.stream)
        self.sensors.read(fleet, self.stream)
        ends = fleet.terminations, fleet.truncations
        return self._observation(), fleet.rewards, *ends, dict(fleet.infos)

    def _observation(self) -> Any:
        images, ranges = self.sensors.images, self.sensors.ranges
        return images if ranges is None else {"camera": images, "lidar": ranges}


def bytes_for(fleet: Fleet, sensors: Sensors) -> int:
    """Return about how many bytes the cars take on a GPU, one set of their pictures included."""
    n, n_objects = len(fleet.states), fleet.objects.settings.n if fleet.objects else 0
    pictures = HEIGHT * WIDTH * len(sensors.eye_offsets)
    numbers = 100 + n_objects * ((AHEAD + 2) * (2 + WAITS) + 20)
    return n * (pictures + 8 * numbers) + sum(level.nbytes for level in sensors.grounds[0][1])
