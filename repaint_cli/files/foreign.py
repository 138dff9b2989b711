"""Places that users name: a file there is replaced only if repaint wrote it, or if they say so.

What repaint wrote carries a mark, or lies in a folder whose page does.
"""

import os
from collections.abc import Iterable
from pathlib import Path

from repaint_cli.errors import StoreError

PAGE_MARK = "<!-- written by repaint -->"
"""The last line of a page, Markdown or HTML."""
PAGES = ("README.md", "report.html")
"""Pages whose mark is for all files beside them."""
PICTURE_MARK = "written by repaint"
"""In the metadata of a PNG or SVG."""
ENDS = 4096
"""Bytes at either end of a file in which a mark stands."""


def check_replaceable(
    paths: Iterable[Path], replace: bool = False, advice: str = "name another, or --replace it"
) -> None:
    """Check, before anything is written, that files are new or written by repaint.

    Args:
        paths: of the files.
        replace: whether any may be replaced.
        advice: what to do otherwise.

    Raises:
        StoreError: a file is there that repaint did not write.
    """
    for path in paths:
        if os.path.lexists(path) and not (replace or _is_ours(path)):
            raise StoreError(f"{path} is there and was not written by repaint; {advice}")


def _is_ours(path: Path) -> bool:
    page, picture = PAGE_MARK.encode(), PICTURE_MARK.encode()
    marks = (page,) if path.suffix in (".md", ".html") else (page, picture)
    if any(mark in _ends_of(path) for mark in marks):
        return True
    pages = [path.with_name(name) for name in PAGES if path.name not in PAGES]
    return any(page in _ends_of(other) for other in pages)


def _ends_of(path: Path) -> bytes:
    """Return the first and the last bytes of a regular file; none of anything else."""
    try:
        if not path.is_file():
            return b""
        with path.open("rb") as file:
            first = file.read(ENDS)
            file.seek(max(0, file.seek(0, os.SEEK_END) - ENDS))
            return first + b"\n" + file.read()
    except OSError:
        return b""
