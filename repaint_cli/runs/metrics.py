"""The numbers of an iteration: the rows of metrics.csv, and what a screen shows."""

import csv
import io
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from repaint_cli.errors import CheckpointError
from repaint_cli.files.atomic import write_text, written_to
from repaint_cli.learn.evaluation import Episodes
from repaint_cli.learn.stats import IterationStats

COLUMNS = (
    "iteration", "seed", "phase", "env_steps", "eval_return", "eval_return_std", "eval_length",
    "eval_progress", "episode_return", "episode_length", "policy_loss", "value_loss", "entropy",
    "approx_kl", "clip_fraction", "explained_variance", "kickstart_coef", "cross_entropy",
    "kept_fraction", "kept_advantage", "kept_reward", "kept_clip_fraction", "student_reward",
    "student_return", "teacher_return",
    "log_ratio", "q_value", "epsilon", "steps_per_second", "seconds",
)  # fmt: skip
"""Of metrics.csv, one row per iteration and seed."""


@dataclass(frozen=True)
class Report:
    """An iteration and the evaluation after it."""

    stats: IterationStats
    evaluation: Episodes
    seconds: float
    """Since the run began."""

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The rows of metrics.csv but for the seed's name, one per seed."""
        played, numbers = self.evaluation, self.stats.metrics
        per_seed = numbers | {
            "eval_return": played.returns.mean(1),
            "eval_return_std": played.returns.std(1),
            "eval_length": played.lengths.mean(1),
        }
        if played.progress is not None:
            per_seed["eval_progress"] = played.progress.mean(1)
        shared = {"iteration": self.stats.iteration, "phase": self.stats.phase}
        n_seeds = len(played.returns)
        return [
            shared | {"seconds": self.seconds} | {name: n[s] for name, n in per_seed.items()}
            for s in range(n_seeds)
        ]


def append_csv(path: Path, rows: list[dict[str, Any]]) -> None:
    """Add rows to metrics.csv; a column without a number stays empty.

    Raises:
        StoreError: the disk is full or the file cannot be written.
    """
    text = io.StringIO()
    csv.DictWriter(text, COLUMNS, lineterminator="\n").writerows(
        {name: _cell(value) for name, value in row.items()} for row in rows
    )
    write_text(path, path.read_text(encoding="utf-8") + text.getvalue())


def start_csv(path: Path) -> None:
    """Write a metrics.csv without rows."""
    write_text(path, ",".join(COLUMNS) + "\n")


def cut_csv(path: Path, k: int, n_seeds: int) -> None:
    """Forget what metrics.csv says of iterations after k.

    Raises:
        CheckpointError: it does not say all of those before.
        StoreError: it cannot be changed.
    """
    try:
        lines = path.read_bytes().splitlines(keepends=True)
    except OSError as error:
        raise CheckpointError(f"cannot read {path}: {error.strerror}") from error
    wanted = 1 + k * n_seeds
    last = (
        lines[wanted - 1].partition(b",")[0].decode(errors="replace")
        if len(lines) >= wanted
        else "nothing"
    )
    if k and last != str(k):
        raise CheckpointError(
            f"{path} is damaged: expected its line {wanted} to be of iteration {k}, as the "
            f"checkpoint beside it is, found {last}"
        )
    with written_to(path):  # which needs no room on a disk
        os.truncate(path, sum(len(line) for line in lines[:wanted]))


def _cell(value: Any) -> Any:
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else f"{value:.6g}"
    return value
