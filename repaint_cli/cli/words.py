"""Texts out of files, on their way to a terminal."""

from collections.abc import Sequence

from rich.markup import escape


def plain(text: object) -> str:
    """Return a text without what a terminal would obey: all but printable characters, spelled out.

    Escape sequences move the cursor, rename the window and hide what was said before; characters
    that turn the direction of writing make a name look like another.
    """
    text = str(text)
    if text.isprintable():  # nearly always
        return text
    return "".join(c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in text)


def literal(text: object) -> str:
    """Return a text for rich, which is to obey none of it either: brackets are brackets."""
    return escape(plain(text))


def columns(title: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return a table of texts, aligned; rich would take seconds for thousands of rows."""
    cells = [list(title), *([plain(cell) for cell in row] for row in rows)]
    widths = [max(len(row[i]) for row in cells) for i in range(len(title))]
    lines = ("  ".join(map(str.ljust, row, widths)).rstrip() for row in cells)
    return "\n".join(lines)
