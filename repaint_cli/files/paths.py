"""Where shipped and user data lie."""

import os
from pathlib import Path

from repaint_cli.errors import StoreError

PACKAGE = Path(__file__).parents[1]


def shipped(kind: str) -> Path:
    """Return where shipped `tasks`, `zoo` or `experiments` lie.

    In the package once installed, else beside it.
    """
    installed = PACKAGE / "_data" / kind
    return installed if installed.is_dir() else PACKAGE.parent / kind


def shipped_tasks() -> dict[str, Path]:
    """Return the shipped cards by name, families together."""
    return {path.stem: path for path in sorted(shipped("tasks").rglob("*.toml"))}


def user_zoo() -> Path:
    """Return where the user's own teachers lie: $REPAINT_HOME/zoo, or in the XDG data folder.

    Raises:
        StoreError: neither is named, and the user has no home folder.
    """
    if home := os.environ.get("REPAINT_HOME"):
        return Path(home) / "zoo"
    if data := os.environ.get("XDG_DATA_HOME"):
        return Path(data) / "repaint" / "zoo"
    try:
        return Path.home() / ".local" / "share" / "repaint" / "zoo"
    except RuntimeError as error:
        raise StoreError(
            "expected a folder for your teachers, found neither REPAINT_HOME nor a home folder; "
            "name one: export REPAINT_HOME=/tmp/repaint"
        ) from error
