"""The numbers of an iteration: the rows of metrics.csv, and what a screen shows."""

import csv
import io
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from repaint_cli.envs.episodes import Episodes
from repaint_cli.errors import CheckpointError
from repaint_cli.files.atomic import append_text, write_errors, write_text
from repaint_cli.learn.stats import IterationStats

COLUMNS = (
    "iteration", "seed", "phase", "env_steps", "eval_return", "eval_return_std", "eval_length",
    "eval_progress", "episode_return", "episode_length", "policy_loss", "value_loss", "entropy",
    "approx_kl", "clip_fraction", "explained_variance", "kickstart_coef", "cross_entropy",
    "kept_fraction", "kept_advantage", "kept_reward", "kept_clip_fraction", "student_reward",
    "student_return", "teacher_return",
    "log_ratio", "q_value", "epsilon", "steps_per_second", "seconds",
    "distill_cross_entropy", "instance_kl",
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
        episodes = self.evaluation
        per_seed = self.stats.metrics | {
            "eval_return": episodes.returns.mean(1),
            "eval_return_std": episodes.returns.std(1),
            "eval_length": episodes.lengths.mean(1),
        }
        if episodes.progress is not None:
            per_seed["eval_progress"] = episodes.progress.mean(1)
        shared = {"iteration": self.stats.iteration, "phase": self.stats.phase}
        n_seeds = len(episodes.returns)
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
    append_text(path, text.getvalue())


def start_csv(path: Path) -> None:
    """Write a metrics.csv without rows."""
    write_text(path, ",".join(COLUMNS) + "\n")


def cut_csv(path: Path, k: int, n_seeds: int) -> None:
    """Cut the rows after iteration k off metrics.csv, the last of which may be half written.

    Raises:
        CheckpointError: a row up to iteration k is absent, or the file cannot be read.
        StoreError: the file cannot be changed.
    """
    try:
        lines = path.read_bytes().splitlines(keepends=True)
    except OSError as error:
        raise CheckpointError(f"cannot read {path}: {error.strerror}") from error
    wanted = 1 + k * n_seeds
    whole = len(lines) >= wanted and lines[wanted - 1].endswith(b"\n")
    last = lines[wanted - 1].partition(b",")[0].decode(errors="replace") if whole else "nothing"
    if k and last != str(k):
        raise CheckpointError(
            f"{path} is damaged: expected its line {wanted} to be of iteration {k}, as the "
            f"checkpoint beside it is, found {last}"
        )
    with write_errors(path):  # which needs no room on a disk
        os.truncate(path, sum(len(line) for line in lines[:wanted]))


def _cell(value: Any) -> Any:
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else f"{value:.6g}"
    return value
