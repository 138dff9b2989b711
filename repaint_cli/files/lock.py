"""A lock on a folder, so that of two processes that would write a run only one does."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from repaint_cli.errors import StoreError
from repaint_cli.files.atomic import write_errors


class Locked(StoreError):
    """Another process has locked the folder."""


@contextmanager
def folder_lock(folder: Path) -> Iterator[None]:
    """Lock a folder; the lock ends with the process, however that ends.

    Nothing is locked where the operating system or the file system has no such lock.

    Raises:
        Locked: another process has locked the folder.
    """
    handle = _acquire(folder)
    try:
        yield
    finally:
        if handle is not None:
            os.close(handle)


def _acquire(folder: Path) -> int | None:
    """Return the open file that holds the lock; None where there is no such lock."""
    try:
        import fcntl
    except ImportError:  # not on Windows
        return None
    with write_errors(folder):
        handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        os.close(handle)
        raise Locked(f"{folder} is being written by another process; wait for it") from error
    except OSError:
        os.close(handle)
        return None
    return handle
