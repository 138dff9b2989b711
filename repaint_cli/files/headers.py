"""Files of weights in the safetensors format, and the JSON header that they carry."""

import json
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open

from repaint_cli.errors import CheckpointError, DamagedFile, reported_as
from repaint_cli.files.limits import MAX_BYTES, check_file, parse

KEY = "repaint"
"""Of our JSON in a safetensors header."""

HASH = "sha256"
"""Of the hash of the file's contents, in our JSON."""

PEEK_BYTES = 2**16
"""Far more than a teacher's header has."""

_JSON = json.JSONDecoder()


def read_header(path: Path) -> dict[str, Any]:
    """Read a safetensors file's JSON header alone; no tensor library is needed.

    Raises:
        CheckpointError: the file is absent, damaged, or not one of ours.
    """
    with open_weights(path, "numpy") as file:
        return header_of(path, file)[0]


def peek_header(path: Path) -> dict[str, Any]:
    """Read a safetensors file's JSON header quickly and unchecked, for a list of thousands.

    A file that is not whole may pass; use `read_header` for more than display.

    Raises:
        CheckpointError: there is no regular file, or no such header in its first 64 KiB.
    """
    try:
        data = _start_of(path)
        text = data[8 : 8 + int.from_bytes(data[:8], "little")].decode()
        start = text.index(f'"{KEY}":') + len(f'"{KEY}":')  # before the tensors, which are not read
        header = json.loads(_JSON.raw_decode(text, start)[0])
    except (OSError, ValueError, LookupError, TypeError, RecursionError) as error:
        raise CheckpointError(f"{path} has no header of ours: {error!r}") from error
    if not isinstance(header, dict):
        raise CheckpointError(f"{path} has no header of ours")
    return header


def _start_of(path: Path) -> bytes:
    """Return a regular file's first bytes; a pipe or a device might never have any."""
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            raise OSError(f"{path} is no regular file")
        return os.read(handle, PEEK_BYTES)
    finally:
        os.close(handle)


def read_hash(path: Path) -> str | None:
    """Return the hash of the contents in a file's header; None in a file of an earlier version.

    Raises:
        CheckpointError: the file is absent or damaged.
    """
    with open_weights(path, "numpy") as file:
        return header_of(path, file)[1]


@contextmanager
def open_weights(path: Path, framework: str) -> Iterator[Any]:
    """Open a safetensors file.

    Raises:
        CheckpointError: the file is absent or damaged.
    """
    if not os.path.exists(path):  # which takes any name
        raise CheckpointError(f"expected a safetensors file at {path}, found none")
    with reported_as(CheckpointError):
        check_file(path)
    try:
        with path.open("rb") as file:  # whose parser takes several times its length in memory
            length = int.from_bytes(file.read(8), "little")
        if length > MAX_BYTES:
            raise CheckpointError(
                f"{path} is not a whole safetensors file (a header of more than {MAX_BYTES:,} "
                "bytes); copy or train it again"
            )
        with safe_open(path, framework=framework) as file:
            yield file
    except (SafetensorError, OSError) as error:
        raise CheckpointError(
            f"{path} is not a whole safetensors file ({error!s:.200}); copy or train it again"
        ) from error


def header_of(path: Path, file: Any) -> tuple[dict[str, Any], str | None]:
    """Return our JSON from an open file's header, and the hash in it; None before 0.1.0.

    Raises:
        CheckpointError: the header has no JSON of ours, or its JSON cannot be read.
    """
    text = (file.metadata() or {}).get(KEY)
    foreign = f"{path} was not written by repaint: its header has no '{KEY}' JSON"
    try:
        header = parse(text, "the header") if text else None
    except DamagedFile as error:
        raise CheckpointError(f"{foreign} that can be read: {error}") from error
    if not isinstance(header, dict):
        raise CheckpointError(foreign)
    return header, header.pop(HASH, None)
