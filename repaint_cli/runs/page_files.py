"""The pictures and films of a run on a page: in it where they are small, else linked."""

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote

from repaint_cli.report.html import embedded
from repaint_cli.runs.folder import RunFolder

LARGEST = 5_000_000
"""Bytes of a file that a page holds."""

LARGEST_PAGE = 10_000_000
"""Bytes of all files that a page holds."""

CAPTIONS = {
    "trajectories": "Where the first seed went in some evaluations of its training.",
    "eval-trajectories": "Where the last policy of the first seed went in repaint eval.",
}

PNG = b"\x89PNG\r\n\x1a\n"


@dataclass(frozen=True)
class Shown:
    """A picture or a film on a page."""

    source: str
    """Its address: its contents, or a path from the page."""
    embedded: bool
    """Whether the page holds it."""
    caption: str
    """What it shows."""


@dataclass
class PageFiles:
    """Takes files into a page while there is room."""

    page: Path
    """Where the page will lie."""
    room: int = field(default=LARGEST_PAGE)
    """Bytes left."""

    def shown(self, path: Path, caption: str) -> Shown:
        """Return a file as the page shows it."""
        size = path.stat().st_size
        if size <= min(self.room, LARGEST):
            self.room -= size
            return Shown(embedded(path), True, caption)
        where = os.path.relpath(path, self.page.parent)
        return Shown(quote(Path(where).as_posix()), False, caption)

    def films(self, files: RunFolder, of: str = "") -> list[Shown]:
        """Return a run's film, where there is one."""
        caption = f"{of}The last policy, filmed by repaint eval."
        return [self.shown(files.film, caption)] if _is_own(files.film) else []

    def pictures(self, pictures: Iterable[Path], of: str = "") -> Iterator[Shown]:
        """Yield some of a run's pictures."""
        for path in pictures:
            yield self.shown(
                path, of + CAPTIONS.get(path.stem, f"{path.stem.replace('-', ' ').capitalize()}.")
            )


def pictures_of(files: RunFolder) -> list[Path]:
    """Return a run's pictures but for its curves, those of paths first."""
    first = [files.trajectories, files.eval_trajectories]
    others = [path for path in sorted(files.path.glob("*.png")) if path not in first]
    return [path for path in [*first, *others] if path != files.curves and _is_picture(path)]


def _is_own(path: Path) -> bool:
    """Tell whether a file is there, and is not another one by a link."""
    return path.is_file() and not path.is_symlink()


def _is_picture(path: Path) -> bool:
    if not _is_own(path):
        return False
    with path.open("rb") as file:
        return file.read(len(PNG)) == PNG
