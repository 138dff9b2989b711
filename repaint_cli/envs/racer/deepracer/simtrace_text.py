"""DeepRacer's logs as text: lines with `SIM_TRACE_LOG:` among whatever else a simulation says."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from repaint_cli.errors import DamagedFile
from repaint_cli.files.atomic import write_errors, write_from, write_text
from repaint_cli.files.limits import MAX_LINE, check_file

COLUMNS = (
    "episode", "steps", "X", "Y", "yaw", "steer", "throttle", "action", "reward", "done",
    "all_wheels_on_track", "progress", "closest_waypoint", "track_len", "tstamp", "episode_status",
    "pause_duration", "obstacle_crash_counter", "wall_clock",
)  # fmt: skip
"""Of a step, in DeepRacer's order, in text as in a simtrace."""
MARK = "SIM_TRACE_LOG:"
"""Stands before the values of a step."""
FORMS = (
    "%d", "%d", "%.4f", "%.4f", "%.4f", "%.2f", "%.2f", "%s", "%.4f", "%s", "%s", "%.4f", "%d",
    "%.2f", "%s", "%s", "%.2f", "%d", "%.4f",
)  # fmt: skip
"""Of the values, as DeepRacer writes them."""
LEAST = COLUMNS.index("episode_status") + 1
"""Values of a line at least; older logs end there or soon after."""
MAX_TEXT_BYTES, MAX_STEPS = 2**31, 2_000_000
"""Of a text, which is read line by line, and of the steps in it, which are kept."""


def text_line(values: Sequence[Any]) -> str:
    """Return a step's line; the values are those of a row of a simtrace, numbers or their texts."""
    written = (
        form % (value if form == "%s" else float(value))
        for form, value in zip(FORMS, values, strict=True)
    )
    return f"{MARK}{','.join(written)}\n"


def read_lines(path: Path) -> Iterator[dict[str, str]]:
    """Yield the steps of a text by column; a last line without its end is none yet.

    Raises:
        DamagedFile: the file cannot be read, is too large, or has a line with `SIM_TRACE_LOG:` and
            too few values.
    """
    check_file(path, MAX_TEXT_BYTES)
    n_steps = 0
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            while line := file.readline(MAX_LINE):  # a longer one comes in pieces
                _, mark, rest = line.partition(MARK)
                if not mark or not rest.endswith("\n"):
                    continue
                values = rest.partition("\t")[0].strip().split(",")
                if len(values) < LEAST:
                    raise ValueError(
                        f"expected at least {LEAST} values after {MARK}, found {len(values)}"
                    )
                n_steps += 1
                if n_steps > MAX_STEPS:
                    raise ValueError(f"expected at most {MAX_STEPS:,} steps, found more")
                yield dict(zip(COLUMNS, values, strict=False))
    except (OSError, ValueError) as error:
        raise DamagedFile(f"cannot read {path!s:.500}: {error}") from error


class TextLog:
    """A text that grows by the steps of an iteration; a resumed run cuts off what came later."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.size = 0
        """Bytes on disk; a file that was there before counts once `cut` was called."""

    def append(self, text: str) -> None:
        """Add lines; the first make the file, in place of any earlier one.

        Raises:
            StoreError: the file cannot be written.
        """
        if self.size:
            write_from(self._path, self.size, text)
        else:
            write_text(self._path, text)
        self.size += len(text.encode())

    def cut(self, size: int) -> None:
        """Leave so many bytes, or as many as there are.

        Raises:
            StoreError: the file cannot be changed.
        """
        with write_errors(self._path):
            there = self._path.stat().st_size if self._path.is_file() else 0
        self.size = min(size, there)
        if self.size:  # else the next lines make the file anew
            write_from(self._path, self.size, "")
        else:
            with write_errors(self._path):
                self._path.unlink(missing_ok=True)
