"""Files written whole or not at all, and files that grow at their end."""

import hashlib
import json
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from repaint_cli.errors import StoreError

UMASK = os.umask(0)
"""Permissions that the user withholds from new files."""
os.umask(UMASK)

TEMPORARY_PREFIX = ".repaint-"
"""Of the names of files and folders that are still being written."""

_guards: dict[Path, Callable[[], None]] = {}
"""What is checked before a write below a folder."""


@contextmanager
def guarded(folder: Path, check: Callable[[], None]) -> Iterator[None]:
    """Have every write below a folder call `check` first, which raises where it may not be."""
    place = folder.absolute()
    _guards[place] = check
    try:
        yield
    finally:
        del _guards[place]


def _check_guards(path: Path) -> None:
    """Call what guards the folders that a path is below."""
    if _guards:
        place = path.absolute()
        for folder, check in list(_guards.items()):
            if place.is_relative_to(folder):
                check()


@contextmanager
def atomic_write(path: Path, *, new: bool = False) -> Iterator[Path]:
    """Yield a temporary path beside `path`, and rename it to `path` if no error was raised.

    Args:
        path: of the file; a reader sees the whole old file or the whole new one.
        new: whether the file must not exist yet; of several writers at once the first wins.

    Raises:
        StoreError: the folder cannot be written, the disk is full, or a file that must not exist
            does; `path` is as it was.
    """
    temporary = path
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(
            dir=path.parent, prefix=TEMPORARY_PREFIX, suffix=path.suffix
        )
        os.close(handle)
        temporary = Path(name)
        yield temporary
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())
        temporary.chmod(0o666 & ~UMASK)
        _check_guards(path)
        if new:
            _link_new(temporary, path)
        else:
            os.replace(temporary, path)
        _sync_folder(path.parent)
    except OSError as error:
        raise StoreError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        if temporary != path:
            with suppress(FileNotFoundError):
                temporary.unlink()


def _link_new(temporary: Path, path: Path) -> None:
    """Give a file its name, unless the name is taken."""
    try:
        os.link(temporary, path)
    except OSError as error:  # a file system without links cannot check in one step
        if path.exists() or path.is_symlink():
            raise StoreError(f"{path} exists already") from error
        os.replace(temporary, path)


def _sync_folder(folder: Path) -> None:
    """Put a new name on the disk, safe from a power failure, where folders can be opened."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


@contextmanager
def write_errors(path: Path) -> Iterator[None]:
    """Raise the operating system's errors as one that names the file or folder.

    Raises:
        StoreError: the file or folder cannot be changed.
    """
    _check_guards(path)
    try:
        yield
    except OSError as error:
        raise StoreError(f"cannot write {path}: {error.strerror or error}") from error


def write_text(path: Path, text: str, *, new: bool = False) -> None:
    """Write a small text file, whole or not at all; it must not exist yet if it is to be `new`.

    Raises:
        StoreError: the file cannot be written; `path` is as it was.
    """
    with atomic_write(path, new=new) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_from(path: Path, start: int, text: str) -> None:
    """Put a text in place of all that a file holds from byte `start` on, and put it on the disk.

    It takes as long for a long file as for a short one. A process that is killed meanwhile leaves a
    part of the text, perhaps followed by a part of the earlier contents.

    Raises:
        StoreError: the file is absent or cannot be written, or the disk is full.
    """
    data = memoryview(text.encode())
    with write_errors(path), path.open("rb+", buffering=0) as file:
        file.seek(start)
        rest = data
        while rest:
            rest = rest[os.write(file.fileno(), rest) :]
        os.ftruncate(file.fileno(), start + len(data))
        _sync_data(file.fileno())


def append_text(path: Path, text: str) -> None:
    """Add a text to the end of a file, as `write_from` does."""
    with write_errors(path):
        size = path.stat().st_size
    write_from(path, size, text)


def _sync_data(handle: int) -> None:
    """Put a file's contents and length on the disk, safe from a power failure."""
    if hasattr(os, "fdatasync"):  # not on macOS
        os.fdatasync(handle)
    else:
        os.fsync(handle)


def as_json(record: Mapping[str, Any]) -> str:
    """Return a record as JSON that people can read."""
    return json.dumps(record, indent=2) + "\n"


def check_writable(folder: Path) -> None:
    """Check that files can be created in a folder; create the folder where it is absent.

    Raises:
        StoreError: no folder or file can be created there.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise StoreError(f"cannot write to {folder}: {error.strerror}") from error


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file's bytes, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
