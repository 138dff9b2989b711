"""What earlier runs left in their folders."""

import os
from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, NonNegativeInt, ValidationError, field_validator

from repaint_cli.errors import CheckpointError, NotFound, reported_as
from repaint_cli.files.limits import read_json, read_rows
from repaint_cli.settings import first_problem
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.methods import ALGORITHMS, METHODS

NUMBERS = (
    "eval_return", "eval_progress", "env_steps", "kickstart_coef", "kept_fraction", "seconds",
)  # fmt: skip
"""The columns of metrics.csv that runs are compared by."""


@dataclass(frozen=True)
class Run:
    """A run's folder, read."""

    folder: Path
    record: dict[str, Any]
    """run.json."""
    task: TaskCard
    """The target task, with the settings it was trained with."""
    rows: dict[str, np.ndarray]
    """The `NUMBERS` of metrics.csv by column, (S, K); nan where a cell is empty."""

    @property
    def method(self) -> str:
        """Which method it ran."""
        return str(self.record["method"])

    @property
    def label(self) -> str:
        """The method, its teachers if it had any, and the algorithm if it was not PPO."""
        teachers = " and ".join(teacher["name"] for teacher in self.record["teachers"])
        algorithm = self.record.get("algorithm", "ppo")
        name = self.method if algorithm == "ppo" else f"{algorithm} {self.method}"
        name += " auto" if self.record.get("automatic") else ""
        return f"{name} from {teachers}" if teachers else name

    @property
    def returns(self) -> np.ndarray:
        """Evaluated mean returns, (S, K)."""
        return self.rows["eval_return"]

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


def read_run(folder: Path) -> Run:
    """Read a run's folder.

    Raises:
        NotFound: there is no run.
        CheckpointError: its files are damaged.
    """
    if not os.path.exists(folder / "run.json"):
        raise NotFound(f"expected a run's folder with run.json, found none at {folder}")
    with reported_as(CheckpointError):
        record = read_json(folder / "run.json")
    if isinstance(record, dict) and record.get("schema_version") == 1:  # which knew one teacher
        record["teachers"] = [record["teacher"]] if record.get("teacher") else []
    try:
        known = _Known.model_validate(record)
    except ValidationError as error:
        raise CheckpointError(f"{folder}/run.json is damaged: {first_problem(error)}") from error
    task = TaskCard.parse(known.task, str(folder / "run.json"))
    try:
        with reported_as(CheckpointError):
            rows = _columns(folder / "metrics.csv", known.seeds)
    except ValueError as error:
        raise CheckpointError(f"{folder}/metrics.csv is damaged: {error!s:.200}") from error
    return Run(folder, record, task, rows)


class _Teacher(BaseModel):
    """What run.json must say of a teacher."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9._-]+$")]


class _Known(BaseModel):
    """What run.json must say; the rest of it is for people."""

    model_config = ConfigDict(strict=True)

    method: str
    algorithm: str = "ppo"
    automatic: bool = False
    seeds: Annotated[list[NonNegativeInt], Field(min_length=1)]
    teachers: list[_Teacher]
    task: dict[str, Any]

    @field_validator("method", "algorithm")
    @classmethod
    def _ours(cls, name: str) -> str:
        if name not in {*METHODS, *ALGORITHMS}:
            raise ValueError("expected a method or an algorithm of ours")
        return name

    @field_validator("seeds")
    @classmethod
    def _once(cls, seeds: list[int]) -> list[int]:
        if len(set(seeds)) < len(seeds):
            raise ValueError("expected every seed once")
        return seeds


def _columns(path: Path, seeds: Sequence[int]) -> dict[str, np.ndarray]:
    """Return the numbers by column, (S, K), of the iterations that every seed has.

    Raises:
        DamagedFile: the file cannot be read.
        ValueError: a cell is no number, or a row out of place.
    """
    mine = {str(seed): array("d") for seed in seeds}
    for row in read_rows(path, ("iteration", "seed", *NUMBERS)):
        own = mine.get(row["seed"])
        if own is None:
            raise ValueError(f"expected the seeds of run.json, found '{row['seed']:.20}'")
        if row["iteration"] != str(len(own) // len(NUMBERS) + 1):
            raise ValueError(
                f"expected iterations 1, 2, … of seed {row['seed']}, found '{row['iteration']:.20}'"
            )
        own.extend(float(row[name] or "nan") for name in NUMBERS)
        if not isfinite(own[-len(NUMBERS)]):
            raise ValueError(f"expected a finite eval_return, found '{row['eval_return']:.20}'")
    length = min(len(own) for own in mine.values())
    table = np.array([own[:length] for own in mine.values()]).reshape(len(mine), -1, len(NUMBERS))
    return {name: table[..., c].copy() for c, name in enumerate(NUMBERS)}


def newest_run(root: Path) -> Path:
    """Return the folder of the run below `root` that wrote last.

    Raises:
        NotFound: there is none.
    """
    runs = [
        path.parent
        for path in root.rglob("run.json")
        if all((path.parent / name).is_file() for name in ("checkpoint.safetensors", "metrics.csv"))
    ]
    if not runs:
        raise NotFound(
            f"expected a run below {root}/, found none; train: repaint train-teacher --task reacher"
        )
    return max(runs, key=lambda folder: (folder / "metrics.csv").stat().st_mtime)
