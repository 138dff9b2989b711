"""What comes of checking a file that is no card, such as a track."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple


class CheckedFile(NamedTuple):
    """A file that is no card, checked."""

    name: str
    """What it holds, by name."""
    facts: str
    """Its facts, for people."""
    picture: Path
    """Where `draw` draws it."""
    draw: Callable[[], None]
    """Draws it."""
    next_command: str
    """The next command worth typing."""
    note: str
    """What was mended while it was read; "" where nothing was."""
