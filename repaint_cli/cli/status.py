"""`repaint status`."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from time import sleep
from typing import TYPE_CHECKING, Annotated

from repaint_cli.cli import completion
from repaint_cli.cli.help_page import OPTIONS
from repaint_cli.cli.options import AsJson, argument, option

if TYPE_CHECKING:
    from repaint_cli.runs.status import RunStatus

SECONDS = 2.0
"""Between two looks."""


def status(
    folder: Annotated[
        Path | None,
        argument(
            "FOLDER",
            "A run, or a folder with runs below it. Default: runs/, and runs begun from here.",
            autocompletion=completion.runs,
        ),
    ] = None,
    watch: Annotated[
        bool,
        option(OPTIONS, None, "Look again every 2 seconds until all runs have ended.", "--watch"),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Show how far runs are: state, iteration, return, time left, machine, attempt.

    It reads their folders, so that it works from wherever these can be seen.

    Examples:
        repaint status runs/reacher/compare-20261128-101500
        repaint status --watch
    """
    from repaint_cli.runs.status import statuses

    def look() -> "list[RunStatus]":
        return statuses(folder)

    if watch:
        return _watch(look, folder, as_json=as_json)
    _print(look(), folder, as_json=as_json)


def _print(rows: "list[RunStatus]", folder: Path | None, *, as_json: bool) -> None:
    if as_json:
        print(json.dumps([row.as_json() for row in rows]), flush=True)
    else:
        print(_text(rows, folder), flush=True)


def _text(rows: "list[RunStatus]", folder: Path | None) -> str:
    from repaint_cli.cli.status_table import status_table
    from repaint_cli.runs.status import summary_of

    return f"{status_table(rows, folder)}\n{summary_of(rows)}"


def _watch(look: "Callable[[], list[RunStatus]]", folder: Path | None, *, as_json: bool) -> None:
    """Show what has changed every few seconds; on a terminal in place of what was there."""
    from repaint_cli.runs.status import ENDED

    before: list[RunStatus] = []
    lines = 0
    while True:
        rows = look()
        if rows != before or sys.stdout.isatty():
            if lines and sys.stdout.isatty() and not as_json:
                sys.stdout.write(f"\x1b[{lines}F\x1b[J")  # up to the table's first line; clear
            _print(rows, folder, as_json=as_json)
            lines = _text(rows, folder).count("\n") + 1
        if all(row.state in ENDED for row in rows):
            return
        before = rows
        sleep(SECONDS)
