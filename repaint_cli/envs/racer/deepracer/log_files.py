"""Which files hold the episodes that a user means by a path."""

import os
from collections.abc import Iterable, Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from repaint_cli.envs.racer.deepracer.simtrace_reader import TRAINING
from repaint_cli.errors import NotFound

SUFFIX = "-iteration.csv"
"""How DeepRacer ends the name of every simtrace."""
MOST_FILES = 10_000
"""In a folder."""


class LogFile(NamedTuple):
    """A file of logged episodes."""

    path: Path
    """Where it lies."""
    label: str
    """What tables call it: "12" of 12-iteration.csv, with what tells it apart before it."""


def find_logs(paths: Sequence[Path]) -> tuple[list[LogFile], list[str]]:
    """Return the files that some files and folders stand for, and what was left out of folders.

    A folder's simtraces are taken, of any layout of DeepRacer's, and of those the training's where
    there are any; where there are none, its texts (*.log).

    Raises:
        NotFound: a path does not exist, or a folder holds no logs or too many files.
    """
    files, notes = list[LogFile](), list[str]()
    for path in paths:
        if not os.path.lexists(path):
            raise NotFound(f"expected logs at '{path!s:.500}', found nothing there")
        if not path.is_dir():
            files.append(LogFile(path, _stem(path)))
            continue
        tables = _below(path, f"*{SUFFIX}")
        training = [table for table in tables if table.parent.name == TRAINING]
        paths = training or tables or _below(path, "*.log")
        if not paths:
            raise NotFound(
                f"expected logs in '{path!s:.500}', *{SUFFIX} or *.log, found none; name a file, "
                "a run's folder or DeepRacer's folder of a model"
            )
        if training and (rest := len(tables) - len(training)):
            notes.append(
                f"{rest} log{'s' * (rest != 1)} of evaluations left out; name the folder or file "
                "to replay one"
            )
        files += [LogFile(one, _label(one, path)) for one in sorted(paths, key=_order)]
    return files, notes


def _below(folder: Path, pattern: str) -> list[Path]:
    """Return the files below a folder whose names match.

    Raises:
        NotFound: there are too many.
    """
    paths = list(islice(folder.rglob(pattern), MOST_FILES + 1))
    if len(paths) > MOST_FILES:
        raise NotFound(f"expected at most {MOST_FILES:,} logs in '{folder}', found more")
    return [path for path in paths if path.is_file()]


def _order(path: Path) -> tuple[str, int, str]:
    """Order files by folder and iteration."""
    number = path.name.partition("-")[0]
    return str(path.parent), int(number) if number.isdecimal() else -1, path.name


def _stem(path: Path) -> str:
    return path.name.removesuffix(SUFFIX) if path.name.endswith(SUFFIX) else path.stem


def _label(path: Path, folder: Path) -> str:
    """Return the folders between, without those that every log lies in, and the file's stem."""
    between: Iterable[str] = path.parent.relative_to(folder).parts
    layout = (TRAINING, "evaluation-simtrace", "deepracer", "sim-trace", "training", "logs")
    return "/".join([*(part for part in between if part not in layout), _stem(path)])
