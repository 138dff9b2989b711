"""Files that are whole or not there, and a safetensors file's JSON header without its tensors."""

import hashlib
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open

from repaint_cli.errors import CheckpointError, StoreError
from repaint_cli.reading import LARGEST, check_file, parsed

KEY = "repaint"
"""Where our JSON stands in a safetensors header."""


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path` to write to, and move it there only if all went well.

    Raises:
        StoreError: the folder cannot be written or the disk is full; `path` is as it was.
    """
    temporary = path
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(
            dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix
        )
        os.close(handle)
        temporary = Path(name)
        yield temporary
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())
        temporary.chmod(0o644)
        os.replace(temporary, path)
    except (OSError, SafetensorError) as error:
        if isinstance(error, SafetensorError) and "I/O" not in str(error):
            raise
        reason = getattr(error, "strerror", None) or str(error)
        raise StoreError(f"cannot write {path}: {reason}") from error
    finally:
        if temporary != path:
            with suppress(FileNotFoundError):
                temporary.unlink()


def write_text(path: Path, text: str) -> None:
    """Write a small text file, whole or not at all."""
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


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
    return hashlib.sha256(path.read_bytes()).hexdigest()


def read_header(path: Path) -> dict[str, Any]:
    """Read a safetensors file's JSON header alone; no tensor library is needed.

    Raises:
        CheckpointError: the file is absent, damaged, or not one of ours.
    """
    with opened(path, "numpy") as file:
        return header_of(path, file)


@contextmanager
def opened(path: Path, framework: str) -> Iterator[Any]:
    """Open a safetensors file.

    Raises:
        CheckpointError: the file is absent or damaged.
    """
    if not os.path.exists(path):  # which takes any name
        raise CheckpointError(f"expected a safetensors file at {path}, found none")
    check_file(path, CheckpointError)
    with path.open("rb") as start:  # whose parser takes several times its length in memory
        if int.from_bytes(start.read(8), "little") > LARGEST:
            raise CheckpointError(
                f"{path} is not a whole safetensors file (a header of more than {LARGEST:,} "
                "bytes); copy or train it again"
            )
    try:
        with safe_open(path, framework=framework) as file:
            yield file
    except (SafetensorError, OSError) as error:
        raise CheckpointError(
            f"{path} is not a whole safetensors file ({error!s:.200}); copy or train it again"
        ) from error


def header_of(path: Path, file: Any) -> dict[str, Any]:
    """Return our JSON from an opened file's header.

    Raises:
        CheckpointError: there is none.
    """
    text = (file.metadata() or {}).get(KEY)
    foreign = f"{path} was not written by repaint: its header has no '{KEY}' JSON"
    try:
        header = parsed(text, "the header", CheckpointError) if text else None
    except CheckpointError as error:
        raise CheckpointError(f"{foreign} that can be read: {error}") from error
    if not isinstance(header, dict):
        raise CheckpointError(foreign)
    return header
