"""With which versions, and when, a result was made."""

from datetime import datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from repaint_cli.history import read_run


def versions() -> dict[str, str]:
    """Return the versions of what results depend on."""
    found = {}
    for name in ("repaint-rl", "torch", "gymnasium", "mujoco", "envpool", "numpy", "numba"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def changed_versions(folder: Path) -> list[str]:
    """Return what to say where a run goes on with other libraries than it began with."""
    theirs, ours = read_run(folder).record["versions"], versions()
    changed = [
        f"{name} {theirs.get(name)} → {ours.get(name)}"
        for name in sorted(theirs.keys() | ours.keys())
        if theirs.get(name) != ours.get(name)
    ]
    said = f"the run goes on with other versions ({', '.join(changed)}): not bit for bit"
    return [said] if changed else []


def stamp() -> str:
    """Return the local time as a folder's name, to the second."""
    return datetime.now().astimezone().strftime("%Y%m%d-%H%M%S")
