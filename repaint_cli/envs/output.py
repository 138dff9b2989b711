"""What the code of environments prints, and what libraries warn of in it.

A training's screen is no place for either. While an environment runs, prints go to whoever asked
for them (`output_to`), and are shown once where nobody did; a warning is a line, once.
Only what Python writes to `sys.stdout` and `sys.stderr` is caught, and only in the thread in which
the environment runs.
"""

import re
import sys
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import get_ident
from typing import Any, TextIO

from repaint_cli.envs.gymnasium.notices import in_our_words
from repaint_cli.errors import StoreError
from repaint_cli.files.atomic import write_errors

SHOWN = 10
"""Different lines of prints that are shown where nobody keeps them, and different warnings."""
EXAMPLE = 60
"""Characters of a line that is shown as an example."""
LARGEST_LOG = 10_000_000
"""Characters of prints that a run keeps."""


class Output:
    """Takes what environments print, and warnings; this one shows both once."""

    def __init__(self) -> None:
        self._line = ""
        self._shown: set[str] = set()

    def prints(self, text: str) -> None:
        """Take what was printed, as it comes: pieces of lines."""
        *lines, self._line = (self._line + text).split("\n")
        for line in filter(str.strip, lines):
            self._show("the environment prints", line.strip())

    def warns(self, text: str) -> None:
        """Take a warning, a line."""
        self._show("warning", text)

    def _show(self, what: str, line: str) -> None:
        if line in self._shown or len(self._shown) > SHOWN:
            return
        self._shown.add(line)
        shown = line if len(self._shown) <= SHOWN else "more of this kind, which is not shown"
        _screen().write(f"{what}: {shown}\n")


class CountedPrints(Output):
    """Counts what is printed, and keeps warnings; shows neither."""

    def __init__(self) -> None:
        super().__init__()
        self.n_lines = 0
        self.warnings = dict[str, None]()
        """In order, each once."""
        self._head = ""

    def prints(self, text: str) -> None:
        """Count lines, and keep the first one."""
        self.n_lines += text.count("\n")
        if len(self._head) < EXAMPLE:
            self._head = (self._head + text).lstrip()

    def warns(self, text: str) -> None:
        """Keep a warning."""
        self.warnings[text] = None

    @property
    def example(self) -> str:
        """The beginning of the first line that is not empty; "" where nothing was printed."""
        return self._head.partition("\n")[0].strip()[:EXAMPLE]


class PrintsInFile(CountedPrints):
    """Keeps prints for a file, which is made with the first of them; warnings are shown once."""

    def __init__(self) -> None:
        super().__init__()
        self.path: Path | None = None
        """Of the file; absent while its folder is not there."""
        self._kept, self._size = list[str](), 0

    def prints(self, text: str) -> None:
        """Count and keep what was printed."""
        super().prints(text)
        if self._size <= LARGEST_LOG:
            self._size += len(text)
            self._kept.append(text if self._size <= LARGEST_LOG else "\n(and so on)\n")

    def warns(self, text: str) -> None:
        """Show a warning, once."""
        Output.warns(self, text)

    @contextmanager
    def kept_in(self, path: Path | None) -> Iterator[None]:
        """Write what was printed to a file by the end of the block, however it ends.

        Raises:
            StoreError: the file cannot be written, and nothing else went wrong.
        """
        self.path = path
        try:
            yield
        except BaseException:
            with suppress(StoreError):
                self.flush()
            raise
        self.flush()

    def flush(self) -> None:
        """Write what was kept to the file, or show it once where there is none.

        Raises:
            StoreError: the file cannot be written.
        """
        if self._kept and self.path is None:
            Output.prints(self, "".join([*self._kept, "\n"]))
        elif self._kept and self.path:
            with write_errors(self.path), self.path.open("a", encoding="utf-8") as file:
                file.write("".join(self._kept))
        self._kept = []


_output = Output()


@contextmanager
def output_to(output: Output) -> Iterator[None]:
    """Let an object take what environments print meanwhile."""
    global _output
    before, _output = _output, output
    try:
        yield
    finally:
        _output = before


@contextmanager
def prints_in_file() -> Iterator[PrintsInFile]:
    """Keep what environments print meanwhile for a file."""
    prints = PrintsInFile()
    with output_to(prints), prints.kept_in(None):
        yield prints


def warn(text: str) -> None:
    """Show a warning of ours as those of libraries, a line, once."""
    _output.warns(text)


class _Captured:
    """Stands for a stream while an environment runs; other threads write to the stream itself."""

    def __init__(self, stream: TextIO) -> None:
        self.stream, self._thread = stream, get_ident()

    def write(self, text: str) -> int:
        """Pass on what is written."""
        if get_ident() != self._thread:
            return self.stream.write(text)
        _output.prints(text)
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Pass on lines."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


class captured:  # noqa: N801 - a context manager, as contextlib's are; a generator is slower
    """Take what is printed, and warned of, while an environment's code runs in this thread."""

    def __enter__(self) -> None:
        self._before = sys.stdout, sys.stderr, warnings.showwarning
        if not isinstance(sys.stdout, _Captured):
            sys.stdout, sys.stderr = _Captured(sys.stdout), _Captured(sys.stderr)
            warnings.showwarning = _take_warning

    def __exit__(self, *_: object) -> None:
        sys.stdout, sys.stderr, warnings.showwarning = self._before


def _take_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    text = in_our_words(re.sub(r"\x1b\[[\d;]*m", "", str(message)))
    if text is None:
        text = f"{Path(filename).name}:{lineno} warns: {str(message).strip()} ({category.__name__})"
    _output.warns(text)


def _screen() -> TextIO:
    stream = sys.stderr
    return stream.stream if isinstance(stream, _Captured) else stream
