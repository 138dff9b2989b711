"""Where shipped and user data lie."""

import os
from pathlib import Path

PACKAGE = Path(__file__).parent


def shipped(kind: str) -> Path:
    """Return where shipped `tasks` or `zoo` lie: in the package once installed, else beside it."""
    installed = PACKAGE / "_data" / kind
    return installed if installed.is_dir() else PACKAGE.parent / kind


def user_zoo() -> Path:
    """Return where the user's own teachers lie: $REPAINT_HOME/zoo, or in the XDG data folder."""
    data = Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share")
    return Path(os.environ.get("REPAINT_HOME") or data / "repaint") / "zoo"
