"""What is typed for a view of a teacher: NAME as it is, NAME:mirrored, NAME:both."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from repaint_cli.errors import UsageError
from repaint_cli.zoo import store

MIRRORED = "mirrored"
"""The mirror image from left to right, which most symmetries are."""

BOTH = "both"
"""The mean of a teacher and its mirror image."""

AUTO = "auto"
"""In place of a teacher, or of its view: the one who earns most before anything is trained."""

VIEW = re.compile(r"([^/\\:]+|.+\.safetensors):([a-z][a-z-]*)")
"""A teacher's name or its file, and a view of it."""

VIEWS = {"none": "", "mirror": MIRRORED, "both": BOTH, "auto": AUTO}
"""By what --view calls them."""


class TeacherFile(NamedTuple):
    """A teacher's file, and how the teacher is looked at."""

    path: Path
    view: str = ""
    """"" as it is, a symmetry's name, or `BOTH`."""

    @property
    def name(self) -> str:
        """The file's name with the view."""
        return with_view(self.path.stem, self.view)


def split(name: str) -> tuple[str, str]:
    """Return a teacher's name or file, and its view, of what was typed."""
    match = VIEW.fullmatch(name)
    return (match[1], match[2]) if match else (name, "")


def with_view(name: str, view: str) -> str:
    """Return what is typed for a view of a teacher."""
    return f"{name}:{view}" if view else name


def find(name: str) -> TeacherFile:
    """Return a teacher's file by what was typed; see `store.find`.

    Raises:
        NotFound: there is no such teacher.
    """
    base, view = split(name)
    return TeacherFile(store.find(base), view)


def in_view(names: Sequence[str], view: str) -> list[str]:
    """Return teachers' names with a view for those that are typed without one.

    Raises:
        UsageError: there is no such view.
    """
    if view not in VIEWS:
        raise UsageError(f"expected --view {', '.join(VIEWS)}, found '{view:.60}'")
    return [
        name if name == AUTO or split(name)[1] else with_view(name, VIEWS[view]) for name in names
    ]
