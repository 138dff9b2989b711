"""Files that are whole or not there, and files that grow at their end."""

import hashlib
import json
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from repaint_cli.errors import StoreError

UMASK = os.umask(0)
"""What the user wants others not to do with new files."""
os.umask(UMASK)

UNFINISHED = ".repaint-"
"""What names of files and folders begin with that nobody has finished yet."""


@contextmanager
def written_whole(path: Path, *, new: bool = False) -> Iterator[Path]:
    """Give a temporary path beside `path` to write to, and move it there only if all went well.

    Args:
        path: of the file; whoever reads it meets the old one or the new one, whole.
        new: whether there must be none yet; of several who write it at once the first wins.

    Raises:
        StoreError: the folder cannot be written, the disk is full, or a file that is to be new is
            there; `path` is as it was.
    """
    temporary = path
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=UNFINISHED, suffix=path.suffix)
        os.close(handle)
        temporary = Path(name)
        yield temporary
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())
        temporary.chmod(0o666 & ~UMASK)
        if new:
            _link(temporary, path)
        else:
            os.replace(temporary, path)
        _sync_folder(path.parent)
    except OSError as error:
        raise StoreError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        if temporary != path:
            with suppress(FileNotFoundError):
                temporary.unlink()


def _link(temporary: Path, path: Path) -> None:
    """Give a file its name, unless something has it."""
    try:
        os.link(temporary, path)
    except OSError as error:  # a file system without links cannot tell in one step
        if path.exists() or path.is_symlink():
            raise StoreError(f"{path} exists already") from error
        os.replace(temporary, path)


def _sync_folder(folder: Path) -> None:
    """Let a new name outlive a power failure, where folders can be opened at all."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Hold a folder, so that of two processes that would write a run only one does.

    The hold ends with the process, however that ends; where the system knows no such lock there is
    none.

    Raises:
        StoreError: another process holds it.
    """
    handle = _held(folder)
    try:
        yield
    finally:
        if handle is not None:
            os.close(handle)


def _held(folder: Path) -> int | None:
    """Return what holds a folder; None where the system or its file system knows no such lock."""
    try:
        import fcntl
    except ImportError:  # not on Windows
        return None
    with written_to(folder):
        handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        os.close(handle)
        raise StoreError(f"{folder} is being written by another process; wait for it") from error
    except OSError:
        os.close(handle)
        return None
    return handle


@contextmanager
def written_to(path: Path) -> Iterator[None]:
    """Say which file or folder cannot be changed.

    Raises:
        StoreError: it cannot.
    """
    try:
        yield
    except OSError as error:
        raise StoreError(f"cannot write {path}: {error.strerror or error}") from error


def write_text(path: Path, text: str) -> None:
    """Write a small text file, whole or not at all."""
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_from(path: Path, start: int, text: str) -> None:
    """Put a text in place of all that a file holds from byte `start` on, and see it on the disk.

    It takes as long for a long file as for a short one. Whoever is killed meanwhile leaves a part
    of the text, after which something of what was there before may stand.

    Raises:
        StoreError: the file is absent or cannot be written, or the disk is full.
    """
    data = memoryview(text.encode())
    with written_to(path), path.open("rb+", buffering=0) as file:
        file.seek(start)
        rest = data
        while rest:
            rest = rest[os.write(file.fileno(), rest) :]
        os.ftruncate(file.fileno(), start + len(data))
        _sync_data(file.fileno())


def append_text(path: Path, text: str) -> None:
    """Add a text to the end of a file, as `write_from` does."""
    with written_to(path):
        size = path.stat().st_size
    write_from(path, size, text)


def _sync_data(handle: int) -> None:
    """Let a file's contents and length outlive a power failure."""
    if hasattr(os, "fdatasync"):  # not on macOS
        os.fdatasync(handle)
    else:
        os.fsync(handle)


def as_json(record: Mapping[str, Any]) -> str:
    """Return a record as JSON that people can read."""
    return json.dumps(record, indent=2) + "\n"


def check_writable(folder: Path) -> None:
    """Check that files can be made in a folder; make it where it is absent.

    Raises:
        StoreError: they cannot.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise StoreError(f"cannot write to {folder}: {error.strerror}") from error


def sha256(path: Path) -> str:
    """Return a file's hash."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
