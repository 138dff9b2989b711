"""What earlier runs left in their folders."""

import csv
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from repaint_cli.errors import CheckpointError, NotFound
from repaint_cli.tasks import TaskCard


@dataclass(frozen=True)
class Run:
    """A run's folder, read."""

    folder: Path
    record: dict[str, Any]
    """run.json."""
    task: TaskCard
    """The target task, with the settings it was trained with."""
    rows: dict[str, np.ndarray]
    """The numbers of metrics.csv by column, (S, K); nan where a column is empty."""

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
    if not (folder / "run.json").is_file():
        raise NotFound(f"expected a run's folder with run.json, found none at {folder}")
    try:
        record = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        if record.get("schema_version") == 1:  # which knew one teacher at most
            record["teachers"] = [record["teacher"]] if record["teacher"] else []
        task = TaskCard.parse(record["task"], str(folder / "run.json"))
        rows = _columns(folder / "metrics.csv", [str(seed) for seed in record["seeds"]])
        for name, found in (("method", record), ("teachers", record), ("eval_return", rows)):
            if name not in found:
                raise KeyError(name)
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise CheckpointError(f"{folder} is damaged: {type(error).__name__}: {error}") from error
    return Run(folder, record, task, rows)


def _columns(path: Path, seeds: list[str]) -> dict[str, np.ndarray]:
    with path.open(encoding="utf-8", newline="") as file:
        reader = csv.DictReader(file)
        rows = list(reader)
    names = [name for name in reader.fieldnames or () if name not in ("seed", "phase")]
    mine = {seed: [row for row in rows if row["seed"] == seed] for seed in seeds}
    length = min(len(own) for own in mine.values())
    return {
        name: np.array(
            [[float(row[name] or "nan") for row in own[:length]] for own in mine.values()]
        )
        for name in names
    }


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
