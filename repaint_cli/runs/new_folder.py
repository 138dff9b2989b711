"""Folders that are made new: no two processes get the same one."""

import errno
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import chain, count
from pathlib import Path

from repaint_cli.errors import StoreError
from repaint_cli.files.atomic import TEMPORARY_PREFIX, UMASK
from repaint_cli.files.lock import folder_lock
from repaint_cli.runs.folder import RunFolder


@contextmanager
def claimed(
    path: Path, write: Callable[[RunFolder], None], *, numbered: bool = False
) -> Iterator[RunFolder]:
    """Make the folder of a new run in one step, with the files that `write` puts into it.

    It is locked before it has its name, as long as the block lasts.

    Args:
        path: of the folder.
        write: writes its first files.
        numbered: whether a number is added to a name that is taken.

    Raises:
        StoreError: the folder exists or cannot be made.
    """
    parent = path.parent
    try:
        parent.mkdir(parents=True, exist_ok=True)
        beginning = Path(tempfile.mkdtemp(dir=parent, prefix=TEMPORARY_PREFIX))
    except FileExistsError as error:
        raise StoreError(f"cannot make {path}: {parent} is no folder") from error
    except OSError as error:
        raise StoreError(f"cannot make {path}: {error.strerror}") from error
    with folder_lock(beginning):
        try:
            write(RunFolder(beginning))
            named = _name(path, beginning, numbered)
        finally:
            shutil.rmtree(beginning, ignore_errors=True)  # which is gone once it is named
        yield named


def _name(path: Path, beginning: Path, numbered: bool) -> RunFolder:
    """Give the first files' folder its name; of several processes one gets it."""
    try:
        beginning.chmod(0o777 & ~UMASK)
        for named in with_numbers(path) if numbered else [path]:
            if not os.path.lexists(named) and _renamed(beginning, named):
                return RunFolder(named)
    except OSError as error:
        raise StoreError(f"cannot make {path}: {error.strerror}") from error
    raise _exists(path)


def check_absent(path: Path) -> None:
    """Check that a run's folder can still be made.

    Raises:
        StoreError: it exists.
    """
    if os.path.lexists(path):
        raise _exists(path)


def _exists(path: Path) -> StoreError:
    return StoreError(f"{path} exists already; name another with --run, or --resume it")


def with_numbers(path: Path) -> Iterator[Path]:
    """Yield a path, and then the same with -2, -3, … at its end."""
    return chain([path], (path.with_name(f"{path.name}-{n}") for n in count(2)))


def make_new(path: Path) -> Path:
    """Make a folder that nobody else has, with a number at its end where the name is taken.

    Raises:
        StoreError: the folder cannot be made.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        for numbered in with_numbers(path):
            with suppress(FileExistsError):
                numbered.mkdir()
                return numbered
    except OSError as error:
        raise StoreError(f"cannot make {path}: {error.strerror}") from error
    raise AssertionError  # numbers do not end


def _renamed(folder: Path, path: Path) -> bool:
    """Rename a folder with files in it; return False if another has that name by now."""
    try:
        os.rename(folder, path)
    except OSError as error:
        if error.errno not in (errno.EEXIST, errno.ENOTEMPTY, errno.ENOTDIR):
            raise
        return False
    return True
