"""Files that other people may have written, read with limits.

A regular file of so many bytes, in UTF-8, so many values and so deep: then nothing that comes after
runs out of memory, stack or time. A file that breaks a limit is a `DamagedFile`; callers raise it
as the error of what the file is, with `errors.reported_as`.
"""

import json
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, TextIO

from repaint_cli.errors import DamagedFile

MAX_BYTES, MAX_TOML_BYTES, MAX_TABLE_BYTES = 8 * 2**20, 2**16, 2**26
"""Of a JSON text or a track, of a TOML text, and of a table, which is read line by line."""
MAX_VALUES, MAX_CELLS = 100_000, 4_000_000
"""Of a JSON text and of a table: what they take in memory is many times their text."""
MAX_DEPTH = 32
"""Lists and objects within one another."""
MAX_LINE = 2**16
"""Of a table, in characters."""

_PART = r"""(?:"(?:[^"\\\n]|\\.){0,99}"|'[^'\n]{0,99}'|[\w-]+)[ \t]*\.[ \t]*"""
_DEEP_KEY = re.compile(rf"(?<![\w-])(?:{_PART}){{{MAX_DEPTH}}}")
"""A TOML key a.b.c of so many parts takes the parser time by the square of their number."""


def read_bytes(path: Path, max_bytes: int = MAX_BYTES) -> bytes:
    """Read a small file.

    Raises:
        DamagedFile: there is no regular file, or the file is too large or cannot be read.
    """
    check_file(path, max_bytes)
    try:
        with path.open("rb") as file:
            data = file.read(max_bytes + 1)
    except OSError as error:
        raise DamagedFile(f"cannot read {path!s:.500}: {error.strerror}") from error
    if len(data) > max_bytes:  # the file has grown meanwhile
        raise DamagedFile(_too_large(path, len(data), max_bytes))
    return data


def check_file(path: Path, max_bytes: int | None = None) -> None:
    """Check that there is a regular file, and that it is no larger than so many bytes.

    Raises:
        DamagedFile: there is no file or a folder, pipe or device, or the file is too large.
    """
    try:
        is_file, size = path.is_file(), path.stat().st_size
    except (OSError, ValueError) as error:  # ValueError: a name that no file can have
        reason = getattr(error, "strerror", None) or error
        raise DamagedFile(f"cannot read {path!s:.500}: {reason}") from error
    if not is_file:
        raise DamagedFile(
            f"cannot read {path!s:.500}: expected a regular file, found something else"
        )
    if max_bytes is not None and size > max_bytes:
        raise DamagedFile(_too_large(path, size, max_bytes))


def _too_large(path: Path, size: int, max_bytes: int) -> str:
    return f"cannot read {path!s:.500}: expected at most {max_bytes:,} bytes, found {size:,}"


def read_text(path: Path, max_bytes: int = MAX_BYTES) -> str:
    """Read a small text; the byte-order mark that some editors put before it is no part of it.

    Raises:
        DamagedFile: the file cannot be read, is too large, or is not UTF-8.
    """
    try:
        return read_bytes(path, max_bytes).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DamagedFile(
            f"cannot read {path!s:.500}: expected UTF-8, found other bytes: {error}"
        ) from None


def read_json(path: Path) -> Any:
    """Read a JSON file.

    Raises:
        DamagedFile: the file cannot be read, or `parse` refuses its text.
    """
    return parse(read_text(path), str(path))


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises:
        DamagedFile: the file cannot be read, or `parse` refuses its text.
    """
    text = read_text(path, MAX_TOML_BYTES).replace("\r\n", "\n")
    if _DEEP_KEY.search(text):
        raise DamagedFile(f"{path}: expected at most {MAX_DEPTH} parts in a key, found more")
    data: dict[str, Any] = parse(text, str(path), tomllib.loads)
    return data


def parse(text: str, where: str, parser: Callable[[str], Any] = json.loads) -> Any:
    """Return the values of a JSON or TOML text.

    Args:
        text: of the file, or of a part of it.
        where: the name of that place, for messages.
        parser: of its format.

    Raises:
        DamagedFile: the text is malformed, has too many levels or values, or holds an integer
            beyond 64 bits or half a character.
    """
    if sum(map(text.count, "[{,")) > MAX_VALUES:
        raise DamagedFile(f"{where}: expected at most {MAX_VALUES:,} values, found more")
    try:
        data = parser(text)
        _check_values(data)
    except RecursionError:
        raise DamagedFile(f"{where}: expected at most {MAX_DEPTH} levels, found more") from None
    except ValueError as error:
        raise DamagedFile(f"{where}: {error}") from error
    return data


def _check_values(data: Any) -> None:
    """Refuse values that other code could not handle.

    Raises:
        ValueError: there are too many levels, an integer beyond 64 bits, or a lone surrogate.
    """
    layer, depth = [data], 0
    while layer:
        depth += 1
        if depth > MAX_DEPTH:
            raise ValueError(f"expected at most {MAX_DEPTH} levels, found more")
        for value in layer:
            if isinstance(value, int) and value.bit_length() > 64:
                raise ValueError("expected numbers of at most 64 bits, found a larger one")
            if isinstance(value, str):
                value.encode()  # a lone surrogate, which no terminal or file takes
        inner = [v for v in layer if isinstance(v, dict | list)]
        layer = [part for v in inner for part in ((*v, *v.values()) if isinstance(v, dict) else v)]


def read_rows(
    path: Path, columns: Iterable[str], *, appended: bool = False
) -> Iterator[dict[str, str]]:
    """Yield a table's rows by column: CSV without quotes, a row a line, read one by one.

    Args:
        path: of the file.
        columns: that the table must have, beside any others.
        appended: whether rows are appended one by one, so that a last line without its end is one
            that is only half there yet, and no row.

    Raises:
        DamagedFile: the file cannot be read, is too large, lacks a column, or has a row with
            more or fewer cells than the first.
    """
    check_file(path, MAX_TABLE_BYTES)
    try:
        with path.open(encoding="utf-8") as file:
            names = _cells(file)
            absent = [name for name in columns if names.count(name) != 1]
            if absent:
                raise ValueError(f"expected one column '{absent[0]}', found {len(names)} others")
            for number in range(MAX_CELLS // len(names)):
                cells = _cells(file, whole=appended)
                if not cells:
                    return
                if len(cells) != len(names):
                    raise ValueError(
                        f"expected {len(names)} cells, found {len(cells)} in row {number + 1}"
                    )
                yield dict(zip(names, cells, strict=True))
        raise ValueError(f"expected at most {MAX_CELLS:,} cells, found more")
    except (OSError, ValueError) as error:
        raise DamagedFile(f"cannot read {path!s:.500}: {error}") from error


def _cells(file: TextIO, *, whole: bool = False) -> list[str]:
    """Return a line's cells; none at the end, which may be a line that is not `whole`.

    Raises:
        ValueError: the line is too long.
    """
    line = file.readline(MAX_LINE)
    if len(line) == MAX_LINE:
        raise ValueError(f"expected lines of less than {MAX_LINE:,} characters, found a longer")
    if not line or (whole and not line.endswith("\n")):
        return []
    return line.rstrip("\n").split(",")
