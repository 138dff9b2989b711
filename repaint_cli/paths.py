"""Where shipped and user data lie."""

import os
from pathlib import Path

PACKAGE = Path(__file__).parent


def shipped(kind: str) -> Path:
    """Return the folder of shipped `tasks` or `zoo`: in the package once installed, beside it in a checkout."""
    installed = PACKAGE / "_data" / kind
    return installed if installed.is_dir() else PACKAGE.parent / kind


def user_zoo() -> Path:
    """Return the folder of the user's own teachers: $REPAINT_HOME/zoo, or in the XDG data folder."""
    data = Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share")
    return Path(os.environ.get("REPAINT_HOME") or data / "repaint") / "zoo"
