"""Commands for people to type: one line each, which a shell reads as the same words."""

import os
import shlex
from pathlib import Path


def command(form: str, *values: str | Path) -> str:
    """Return a command; each {} of its form is a value, quoted where a shell needs that.

    A value that begins with a dash is a path, since no task or teacher is called so.
    """
    return form.format(*(quoted(os.fspath(value)) for value in values))


def quoted(text: str) -> str:
    """Return a word for a shell; with $'…', as bash and zsh read it, where it is not printable."""
    if text.startswith("-"):
        text = f"./{text}"
    if text.isprintable():
        return shlex.quote(text)
    return f"$'{''.join(map(_escaped, text))}'"


def _escaped(letter: str) -> str:
    if letter in "\\'":
        return f"\\{letter}"
    if letter.isprintable():
        return letter
    return "".join(f"\\x{byte:02x}" for byte in os.fsencode(letter))
