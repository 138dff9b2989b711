"""How the game's process is started: what it prints is kept, and shown where it does not start.

PySC2 lets it print between the lines of a training's screen.
"""

import subprocess
from collections.abc import Sequence
from tempfile import TemporaryFile
from typing import IO, Any

LONGEST = 4096
"""Bytes from the end of what was printed that are looked at."""

_printed: IO[bytes] | None = None
"""What the process that was started last prints."""


def launch(_: Any, run_config: Any, args: Sequence[str], **__: Any) -> "subprocess.Popen[bytes]":
    """Start the game's process; it stands for PySC2's `StarcraftProcess._launch`."""
    global _printed
    from pysc2.lib import sc_process

    if _printed is not None:
        _printed.close()  # the process before it writes on
    _printed = TemporaryFile()  # noqa: SIM115 - the process has it, too
    try:
        return subprocess.Popen(
            args, cwd=run_config.cwd, env=run_config.env,
            stdin=subprocess.DEVNULL, stdout=_printed, stderr=subprocess.STDOUT,
        )  # fmt: skip
    except OSError as error:
        raise sc_process.SC2LaunchError(f"{error.strerror}: {args[0]}") from error


def last_words() -> str:
    """Return the last line that the game has printed, or that it printed nothing."""
    if _printed is None:
        return "it printed nothing"
    _printed.seek(max(0, _printed.seek(0, 2) - LONGEST))
    lines = _printed.read().decode("utf-8", "replace").split("\n")
    last = next((line.strip() for line in reversed(lines) if line.strip()), None)
    return f"its last line: {last:.200}" if last else "it printed nothing"
