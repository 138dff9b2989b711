"""With which versions, and when, a result was made."""

from datetime import datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version


def versions() -> dict[str, str]:
    """Return the versions of what results depend on, by the name of the package."""
    return dict(_installed())


@cache
def _installed() -> dict[str, str]:
    """Return these versions, for which many files are read, once in a process."""
    installed = {}
    for name in ("repaint-rl", "torch", "gymnasium", "mujoco", "envpool", "numpy", "numba"):
        try:
            installed[name] = version(name)
        except PackageNotFoundError:
            continue
    return installed


def stamp() -> str:
    """Return the local time as a folder's name, to the second."""
    return datetime.now().astimezone().strftime("%Y%m%d-%H%M%S")
