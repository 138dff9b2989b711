"""Standard output that may be closed, full, or without UTF-8."""

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from repaint_cli.errors import OutputError


class _Output(io.TextIOWrapper):
    """Standard output whose errors are ours: others of the kind are about files."""

    def write(self, text: str) -> int:
        """Write a text.

        Raises:
            OutputError: it cannot be written.
        """
        with _output_errors():
            return super().write(text)

    def flush(self) -> None:
        """Write what is held back.

        Raises:
            OutputError: it cannot be written.
        """
        with _output_errors():
            super().flush()


@contextmanager
def _output_errors() -> Iterator[None]:
    try:
        yield
    except BrokenPipeError:  # the reader has ended, which is no error
        raise
    except OSError as error:
        raise OutputError(f"cannot write to standard output: {error.strerror}") from error


def guard_output() -> None:
    """Make errors of standard output ours, and spell out what a terminal without UTF-8 lacks.

    Raises:
        OutputError: it is closed.
    """
    if isinstance(sys.stderr, io.TextIOWrapper):
        sys.stderr.reconfigure(errors="backslashreplace")
    if sys.stdout is None:
        raise OutputError(
            "expected a standard output, found it closed; give it a place: repaint … >/dev/null"
        )
    if type(sys.stdout) is io.TextIOWrapper:
        encoding, by_line = sys.stdout.encoding, sys.stdout.line_buffering
        sys.stdout = _Output(sys.stdout.detach(), encoding, "backslashreplace", None, by_line)


def drop_output() -> None:
    """Let what is still held back for standard output go nowhere: it would fail again."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.close(null)
