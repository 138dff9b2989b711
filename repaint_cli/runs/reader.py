"""What earlier runs left in their folders."""

import os
from array import array
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path

import numpy as np

from repaint_cli.errors import CheckpointError, NotFound, reported_as
from repaint_cli.files.limits import read_rows
from repaint_cli.runs.elsewhere import runs_from_here
from repaint_cli.runs.folder import RUNS, RunFolder, runs_in
from repaint_cli.runs.record import RunRecord
from repaint_cli.tasks.card import TaskCard

FEW = 5
"""Runs that a message names."""

READ_COLUMNS = (
    "eval_return", "eval_progress", "env_steps", "kickstart_coef", "kept_fraction", "seconds",
)  # fmt: skip
"""The columns of metrics.csv that runs are compared by."""


@dataclass(frozen=True)
class RecordedRun:
    """What a run's folder holds; the run itself may go on."""

    files: RunFolder
    """Where its files lie."""
    record: RunRecord
    """What run.json says."""
    task: TaskCard
    """The target task, with the settings it was trained with."""
    rows: dict[str, np.ndarray]
    """The `READ_COLUMNS` of metrics.csv by column, (S, K); nan where a cell is empty."""

    @property
    def folder(self) -> Path:
        """Where it lies."""
        return self.files.path

    @property
    def method(self) -> str:
        """Which method it ran."""
        return self.record.method

    @property
    def seeds(self) -> list[int]:
        """The run seeds, (S,)."""
        return self.record.seeds

    @property
    def label(self) -> str:
        """The method, its teachers if it had any, and the algorithm if it was not PPO."""
        teachers = " and ".join(teacher.label for teacher in self.record.teachers)
        algorithm = self.record.algorithm
        name = self.method if algorithm == "ppo" else f"{algorithm} {self.method}"
        name += " auto" if self.record.automatic else ""
        return f"{name} from {teachers}" if teachers else name

    @property
    def returns(self) -> np.ndarray:
        """Evaluated mean returns, (S, K)."""
        return self.rows["eval_return"]

    def until(self, k: int) -> "RecordedRun":
        """Return the run as it was after iteration k."""
        return replace(self, rows={name: cells[:, :k] for name, cells in self.rows.items()})

    @property
    def taught_until(self) -> int:
        """The last iteration in which a teacher had a part, from 1; 0 if none had."""
        advised = np.nan_to_num(self.rows["kickstart_coef"]) > 0
        taught = (advised | ~np.isnan(self.rows["kept_fraction"])).any(0)
        return int(taught.nonzero()[0].max(initial=-1)) + 1

    @property
    def progress(self) -> np.ndarray | None:
        """Evaluated mean lap progress, (S, K) in %; None off the track."""
        progress = self.rows["eval_progress"]
        return None if np.isnan(progress).all() else progress


def read_run(folder: Path, *, to_resume: bool = False) -> RecordedRun:
    """Read a run's folder.

    Args:
        folder: where it lies.
        to_resume: whether run.json must hold all that a resumed run needs.

    Raises:
        NotFound: the folder is no run's.
        CheckpointError: run.json or metrics.csv is damaged, or cannot be resumed if it is to be.
    """
    files = RunFolder(folder)
    if not os.path.exists(files.record):  # which takes any name
        raise NotFound(
            f"expected a run's folder with run.json, found none at {folder}{newest_named()}"
        )
    record = RunRecord.read_resumable(files) if to_resume else RunRecord.read(files)
    task = TaskCard.parse(record.task, str(files.record))
    try:
        with reported_as(CheckpointError):
            rows = _columns(files.metrics, record.seeds)
    except ValueError as error:
        raise CheckpointError(f"{files.metrics} is damaged: {error!s:.200}") from error
    return RecordedRun(files, record, task, rows)


def _columns(path: Path, seeds: Sequence[int]) -> dict[str, np.ndarray]:
    """Return the numbers by column, (S, K), of the iterations that every seed has.

    Raises:
        DamagedFile: the file cannot be read.
        ValueError: a cell is no number, or a row out of place.
    """
    table = {str(seed): array("d") for seed in seeds}
    for row in read_rows(path, ("iteration", "seed", *READ_COLUMNS), appended=True):
        own = table.get(row["seed"])
        if own is None:
            raise ValueError(f"expected the seeds of run.json, found '{row['seed']:.20}'")
        if row["iteration"] != str(len(own) // len(READ_COLUMNS) + 1):
            raise ValueError(
                f"expected iterations 1, 2, … of seed {row['seed']}, found '{row['iteration']:.20}'"
            )
        own.extend(float(row[name] or "nan") for name in READ_COLUMNS)
        if not isfinite(own[-len(READ_COLUMNS)]):
            raise ValueError(f"expected a finite eval_return, found '{row['eval_return']:.20}'")
    length = min(len(own) for own in table.values())
    cells = np.array([own[:length] for own in table.values()]).reshape(
        len(table), -1, len(READ_COLUMNS)
    )
    return {name: cells[..., c].copy() for c, name in enumerate(READ_COLUMNS)}


def newest_runs(root: Path = RUNS) -> list[Path]:
    """Return the folders of runs below `root`, and of those begun from here, the newest first.

    Only of those with a checkpoint and metrics, by when they wrote last.
    """
    written = dict[Path, float]()
    for files in [*runs_in(root, deep=True), *runs_from_here()]:
        with suppress(OSError):  # it is being removed, or has not written yet
            if files.checkpoint.is_file() and files.record.is_file():
                written[files.path] = files.metrics.stat().st_mtime
    return sorted(written, key=lambda folder: -written[folder])


def newest_run(root: Path = RUNS) -> Path:
    """Return the folder of the run that wrote last, of those below `root` and begun from here.

    Raises:
        NotFound: no such run has a checkpoint and metrics.
    """
    runs = newest_runs(root)
    if not runs:
        raise NotFound(
            f"expected a run below {root}/, found none; train: repaint train-teacher --task reacher"
        )
    return runs[0]


def newest_named() -> str:
    """Return the newest runs as the end of a message about one that is not there."""
    runs = [str(folder) for folder in newest_runs()[:FEW]]
    return f"; the newest {'run is' if len(runs) == 1 else 'runs are'} {', '.join(runs)}" * bool(
        runs
    )
