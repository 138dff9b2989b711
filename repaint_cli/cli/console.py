"""Texts on their way to a terminal, and a question."""

import shutil
import textwrap
from collections.abc import Sequence

import typer
from rich.markup import escape

from repaint_cli.errors import RepaintError

LEAST = 20
"""Characters that the last column of a table is wrapped to at least."""


def plain(text: object) -> str:
    """Return a text with all but printable characters spelled out: a terminal would obey them.

    Escape sequences move the cursor, rename the window and hide earlier text; characters
    that turn the direction of writing make a name look like another.
    """
    text = str(text)
    if text.isprintable():  # nearly always
        return text
    return "".join(c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in text)


def literal(text: object) -> str:
    """Return a text for rich, which reads no markup in it."""
    return escape(plain(text))


def columns(title: Sequence[str], rows: Sequence[Sequence[object]], *, fit: bool = False) -> str:
    """Return a table of texts, aligned; rich would take seconds for thousands of rows.

    Args:
        title: the columns' heads.
        rows: the cells.
        fit: whether to wrap the last column so that the table fits the terminal, or 80 columns.
    """
    cells = [list(title), *([plain(cell) for cell in row] for row in rows)]
    widths = [max(len(row[i]) for row in cells) for i in range(len(title))]
    indent = sum(widths[:-1]) + 2 * (len(widths) - 1)
    room = shutil.get_terminal_size().columns - indent if fit else 0
    lines = []
    for *row, last in cells:
        first, *more = (
            textwrap.wrap(last, room, break_on_hyphens=False) or [""] if room > LEAST else [last]
        )
        lines.append("  ".join(map(str.ljust, [*row, first], widths)).rstrip())
        lines += [" " * indent + line for line in more]
    return "\n".join(lines)


def confirm(question: str) -> bool:
    """Ask a person, and return whether they agree.

    Raises:
        RepaintError: there is nobody to answer.
    """
    try:
        return typer.confirm(question)
    except typer.Abort as end:
        if isinstance(end.__context__, KeyboardInterrupt):
            raise
        raise RepaintError("expected an answer, and there is nobody to ask; try --yes") from end
