"""Runs that lie elsewhere than below runs/: a list of where they are, by where they were begun.

A line is a JSON object; lines that are damaged, and runs that are gone, are passed over.
"""

import json
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from repaint_cli.errors import DamagedFile, StoreError
from repaint_cli.files.limits import read_text
from repaint_cli.files.paths import user_zoo
from repaint_cli.runs.folder import RUNS, RunFolder


def remember(folder: Path) -> None:
    """Note where a run of the present folder lies, unless it is below runs/ or noted already.

    A list that cannot be written is no reason to stop a training.
    """
    with suppress(OSError, StoreError):
        run, here = folder.absolute(), Path.cwd()
        if run.is_relative_to(RUNS.absolute()) or run in _noted(here):
            return
        path = _list()
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"from": str(here), "run": str(run)}) + "\n")


def runs_from_here() -> list[RunFolder]:
    """Return the runs elsewhere that were begun in the present folder, by paths from here."""
    try:
        here = Path.cwd()
    except OSError:  # the present folder is gone
        return []
    return [
        RunFolder(run.relative_to(here) if run.is_relative_to(here) else run)
        for run in dict.fromkeys(_noted(here))
    ]


def _list() -> Path:
    return user_zoo().parent / "runs.jsonl"


def _noted(here: Path) -> Iterator[Path]:
    """Yield the runs that were begun in a folder."""
    try:
        lines = read_text(_list()).splitlines()
    except (DamagedFile, StoreError):  # there is none yet
        return
    for line in lines:
        with suppress(ValueError, TypeError, KeyError):
            entry = json.loads(line)
            if entry["from"] == str(here):
                yield Path(entry["run"])
