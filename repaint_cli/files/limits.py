"""Files that somebody else may have written, read with limits.

A regular file of so many bytes, in UTF-8, so many values and so deep: then nothing that comes after
runs out of memory, of stack or of patience.
"""

import json
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, TextIO

from repaint_cli.errors import RepaintError

LARGEST, LARGEST_CARD, LARGEST_TABLE = 8 * 2**20, 2**16, 2**26
"""Bytes of a JSON text or a track, of a card, and of a table, which is read line by line."""
MOST_VALUES, MOST_CELLS = 100_000, 4_000_000
"""Of a JSON text and of a table: what they take in memory is many times their text."""
DEEPEST = 32
"""Lists and objects within one another."""
LONGEST_LINE = 2**16
"""Of a table, in characters."""

_PART = r"""(?:"(?:[^"\\\n]|\\.){0,99}"|'[^'\n]{0,99}'|[\w-]+)[ \t]*\.[ \t]*"""
_DEEP_KEY = re.compile(rf"(?<![\w-])(?:{_PART}){{{DEEPEST}}}")
"""A TOML key a.b.c of so many parts takes the parser time by the square of their number."""


def read_bytes(path: Path, error: type[RepaintError], most: int = LARGEST) -> bytes:
    """Read a small file.

    Args:
        path: where.
        error: what to raise.
        most: bytes it may have.

    Raises:
        RepaintError: there is no regular file, it is larger, or it cannot be read; of kind `error`.
    """
    check_file(path, error, most)
    try:
        with path.open("rb") as file:
            data = file.read(most + 1)
    except OSError as problem:
        raise error(f"cannot read {path!s:.500}: {problem.strerror}") from problem
    if len(data) > most:  # it has grown meanwhile
        raise error(_too_large(path, len(data), most))
    return data


def check_file(path: Path, error: type[RepaintError], most: int | None = None) -> None:
    """Check that there is a regular file, and that it is no larger than so many bytes.

    Raises:
        RepaintError: there is none: a folder, a pipe and a device are not read; of kind `error`.
    """
    try:
        found, size = path.is_file(), path.stat().st_size
    except (OSError, ValueError) as problem:  # of a name that no file can have
        reason = getattr(problem, "strerror", None) or problem
        raise error(f"cannot read {path!s:.500}: {reason}") from problem
    if not found:
        raise error(f"cannot read {path!s:.500}: expected a regular file, found something else")
    if most is not None and size > most:
        raise error(_too_large(path, size, most))


def _too_large(path: Path, size: int, most: int) -> str:
    return f"cannot read {path!s:.500}: expected at most {most:,} bytes, found {size:,}"


def read_text(path: Path, error: type[RepaintError], most: int = LARGEST) -> str:
    """Read a small text; see `read_bytes`.

    Raises:
        RepaintError: it cannot be read, or is not UTF-8; of kind `error`.
    """
    try:
        return read_bytes(path, error, most).decode()
    except UnicodeDecodeError as problem:
        raise error(
            f"cannot read {path!s:.500}: expected UTF-8, found other bytes: {problem}"
        ) from None


def read_json(path: Path, error: type[RepaintError]) -> Any:
    """Read a JSON text; see `parsed`."""
    return parsed(read_text(path, error), str(path), error)


def read_toml(path: Path, error: type[RepaintError]) -> dict[str, Any]:
    """Read a TOML text; see `parsed`."""
    text = read_text(path, error, LARGEST_CARD).replace("\r\n", "\n")
    if _DEEP_KEY.search(text):
        raise error(f"{path}: expected at most {DEEPEST} parts in a key, found more")
    data: dict[str, Any] = parsed(text, str(path), error, tomllib.loads)
    return data


def parsed(
    text: str, where: str, error: type[RepaintError], parse: Callable[[str], Any] = json.loads
) -> Any:
    """Return what a JSON or TOML text says.

    Args:
        text: it.
        where: it stands, for messages.
        error: what to raise.
        parse: its parser.

    Raises:
        RepaintError: it is malformed, too deep or too much, or holds a whole number beyond 64 bits
            or half a character; of kind `error`.
    """
    if sum(map(text.count, "[{,")) > MOST_VALUES:
        raise error(f"{where}: expected at most {MOST_VALUES:,} values, found more")
    try:
        found = parse(text)
        _check_values(found)
    except RecursionError:
        raise error(f"{where}: expected at most {DEEPEST} levels, found more") from None
    except ValueError as problem:
        raise error(f"{where}: {problem}") from problem
    return found


def _check_values(found: Any) -> None:
    """Refuse what would break whoever works with it.

    Raises:
        ValueError: saying what it is.
    """
    layer, depth = [found], 0
    while layer:
        depth += 1
        if depth > DEEPEST:
            raise ValueError(f"expected at most {DEEPEST} levels, found more")
        for value in layer:
            if isinstance(value, int) and value.bit_length() > 64:
                raise ValueError("expected numbers of at most 64 bits, found a larger one")
            if isinstance(value, str):
                value.encode()  # a lone surrogate, which no terminal or file takes
        inner = [v for v in layer if isinstance(v, dict | list)]
        layer = [part for v in inner for part in ((*v, *v.values()) if isinstance(v, dict) else v)]


def read_rows(
    path: Path, error: type[RepaintError], needed: Iterable[str], *, appended: bool = False
) -> Iterator[dict[str, str]]:
    """Yield a table's rows by column: CSV without quotes, a row a line, read one by one.

    Args:
        path: where.
        error: what to raise.
        needed: columns that it must have, beside any others.
        appended: whether rows are appended one by one, so that a last line without its end is one
            that is only half there yet, and no row.

    Raises:
        RepaintError: the file cannot be read, is too much, lacks a column, or a row has other
            columns than the first; of kind `error`.
    """
    check_file(path, error, LARGEST_TABLE)
    try:
        with path.open(encoding="utf-8") as file:
            names = _cells(file)
            absent = [name for name in needed if names.count(name) != 1]
            if absent:
                raise ValueError(f"expected one column '{absent[0]}', found {len(names)} others")
            for number in range(MOST_CELLS // len(names)):
                cells = _cells(file, whole=appended)
                if not cells:
                    return
                if len(cells) != len(names):
                    raise ValueError(
                        f"expected {len(names)} cells, found {len(cells)} in row {number + 1}"
                    )
                yield dict(zip(names, cells, strict=True))
        raise ValueError(f"expected at most {MOST_CELLS:,} cells, found more")
    except (OSError, ValueError) as problem:
        raise error(f"cannot read {path!s:.500}: {problem}") from problem


def _cells(file: TextIO, *, whole: bool = False) -> list[str]:
    """Return a line's cells; none at the end, which may be a line that is not `whole`.

    Raises:
        ValueError: it is too long.
    """
    line = file.readline(LONGEST_LINE)
    if len(line) == LONGEST_LINE:
        raise ValueError(f"expected lines of less than {LONGEST_LINE:,} characters, found a longer")
    if not line or (whole and not line.endswith("\n")):
        return []
    return line.rstrip("\n").split(",")
