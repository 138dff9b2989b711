"""Whether a GPU works here and is large enough, said in one line where not."""

from importlib.util import find_spec
from typing import TYPE_CHECKING

from repaint_cli.envs.racer.dynamics.commands import Commands
from repaint_cli.envs.racer.dynamics.fleet import Fleet
from repaint_cli.envs.racer.dynamics.race import Race
from repaint_cli.envs.racer.sight.sensors import Sensors
from repaint_cli.errors import CardError, DeviceError

if TYPE_CHECKING:
    from repaint_cli.envs.racer.device.racer import DeviceRacer

INSTEAD = "or leave the device out: the CPU drives the same races"


def cars_on_gpu(
    fleet: Fleet, sensors: Sensors, commands: Commands, parks: bool, race: Race | None
) -> "DeviceRacer":
    """Make on a GPU what is on the CPU.

    Raises:
        CardError: something is asked for that only the CPU does.
        DeviceError: no GPU works, or it is too small.
    """
    only_there = {
        "several tracks": len(fleet.tracks) > 1,
        "races of several laps": race is not None,
        "noise in actions and pictures": sensors.noise is not None,
        "random light or colours": sensors.appearance is not None,
    }
    for what, asked in only_there.items():
        if asked:
            raise CardError(f"expected what a GPU can drive, found {what}; {INSTEAD}")
    check_card()
    from repaint_cli.envs.racer.device.racer import DeviceRacer

    return DeviceRacer(fleet, sensors, commands, parks)


def check_on_cpu(what: str, cars: "DeviceRacer | None") -> None:
    """Check that what is asked for is not asked of cars on a GPU.

    Raises:
        CardError: it is.
    """
    if cars is not None:
        raise CardError(f"expected cars on the CPU for {what}, found them on a GPU; {INSTEAD}")


def check_card() -> None:
    """Check that numba-cuda is installed, and finds a GPU whose driver is new enough.

    Raises:
        DeviceError: one of them is not so.
    """
    from numba import config

    if vars(config)["ENABLE_CUDASIM"]:
        return
    if find_spec("numba_cuda") is None:
        raise DeviceError(
            "expected numba-cuda for cars on a GPU, found none; "
            f"pip install 'numba-cuda[cu13]' brings it, {INSTEAD}"
        )
    from numba import cuda

    if not cuda.is_available():
        raise DeviceError(
            f"expected a GPU for the cars, found none ({_reason()}); see what nvidia-smi says, "
            f"{INSTEAD}"
        )
    from numba.cuda.cudadrv import driver, runtime

    check_versions(driver.get_version(), runtime.get_version())


def check_versions(driver: tuple[int, int], toolkit: tuple[int, int]) -> None:
    """Check that a driver runs what a toolkit compiles: it is of its major version, or newer.

    Raises:
        DeviceError: it is older.
    """
    if driver[0] < toolkit[0]:
        made_for, installed = (".".join(map(str, version)) for version in (toolkit, driver))
        raise DeviceError(
            f"expected a driver for CUDA {toolkit[0]} or newer, as numba-cuda compiles with CUDA "
            f"{made_for}, found one for {installed}; update the driver, install "
            f"'numba-cuda[cu{driver[0]}]', {INSTEAD}"
        )


def check_memory(needed: int, n: int) -> None:
    """Check that the GPU has so many bytes free, for n cars.

    Raises:
        DeviceError: it has fewer.
    """
    from numba import config, cuda

    free = (
        needed if vars(config)["ENABLE_CUDASIM"] else cuda.current_context().get_memory_info().free
    )
    check_free(needed, int(free), n)


def check_free(needed: int, free: int, n: int) -> None:
    """Check that `needed` bytes for n cars are `free`; see `check_memory`."""
    if needed > free:
        raise DeviceError(
            f"expected {needed:,} bytes free on the GPU for {n:,} cars, found {free:,}; take "
            f"fewer cars (about {max(n * free // needed, 0):,} fit), {INSTEAD}"
        )


def _reason() -> str:
    """Return why there is no GPU, as numba-cuda has it."""
    from numba.cuda.cudadrv.driver import driver

    text = (str(driver.initialization_error or "").strip().splitlines() or [""])[0]
    return f"{text:.160}".rstrip(".") or "no reason given"
