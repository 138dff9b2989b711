"""What a run has behind it: claimed once, put on disk with every iteration, found again."""

import os
import shutil
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from repaint_cli import evaluations
from repaint_cli.alarms import IN_A_ROW, Alarm
from repaint_cli.errors import CheckpointError, StoreError
from repaint_cli.files import UMASK, as_json, write_text
from repaint_cli.learn.learner import Learner
from repaint_cli.metrics import cut_csv, start_csv
from repaint_cli.plans import Plan, difference
from repaint_cli.snapshot import load_learner, save_learner
from repaint_cli.teaching import Staff

CHECKPOINT = "checkpoint.safetensors"
"""All that the learner is after the last finished iteration."""

EARLIER = "checkpoint-*.safetensors"
"""Those before it, by iteration."""


@dataclass
class Past:
    """What the run remembers beside its learner."""

    seconds: float = 0.0
    """How long it has taken."""
    best_return: float = float("-inf")
    """Of the best evaluated policy so far."""
    alarms: list[Alarm] = field(default_factory=list)
    """What looked wrong."""
    returns: list[np.ndarray] = field(default_factory=list)
    """Evaluated returns (S, E) after the last iterations, as many as alarms look back."""
    logs: list[Mapping[str, float]] = field(default_factory=list)
    """How far each seed's log of its drives is."""
    notices: list[str] = field(default_factory=list)
    """What was wrong with how it was found."""

    def see(self, returns: np.ndarray, seconds: float, logs: list[Mapping[str, float]]) -> None:
        """Take in an iteration."""
        self.returns = [*self.returns, returns][1 - IN_A_ROW :]
        self.seconds, self.logs = seconds, logs

    def record(self) -> dict[str, Any]:
        """Return it as JSON."""
        return {
            "seconds": self.seconds,
            "best_return": self.best_return,
            "alarms": [alarm.record() for alarm in self.alarms],
            "returns": [returns.tolist() for returns in self.returns],
            "logs": self.logs,
        }

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> "Past":
        """Return what `record` told."""
        return cls(
            seconds=record["seconds"],
            best_return=record["best_return"],
            alarms=[Alarm(**alarm) for alarm in record["alarms"]],
            returns=[np.array(returns) for returns in record["returns"]],
            logs=record["logs"],
        )


def claim(folder: Path, record: Mapping[str, Any]) -> None:
    """Make the folder of a new run, with its record and no metrics, at one stroke.

    Raises:
        StoreError: it exists or cannot be made.
    """
    if folder.exists():
        raise StoreError(f"{folder} exists already; name another with --run, or --resume it")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        beginning = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}-"))
    except FileExistsError as error:
        raise StoreError(f"cannot make {folder}: {folder.parent} is no folder") from error
    except OSError as error:
        raise StoreError(f"cannot make {folder}: {error.strerror}") from error
    try:
        write_text(beginning / "run.json", as_json(record))
        start_csv(beginning / "metrics.csv")
        beginning.chmod(0o777 & ~UMASK)
        os.rename(beginning, folder)
    except OSError as error:
        raise StoreError(f"cannot make {folder}: {error.strerror}") from error
    finally:
        shutil.rmtree(beginning, ignore_errors=True)


def save_checkpoint(plan: Plan, staff: Staff, learner: Learner, past: Past) -> None:
    """Write all that the run is after an iteration; keep as many earlier ones as asked.

    Raises:
        StoreError: it cannot be written; the one before is as it was.
    """
    path = plan.folder / CHECKPOINT
    if plan.keep > 1 and path.is_file():
        earlier = plan.folder / EARLIER.replace("*", f"{learner.iteration - 1:05}")
        earlier.unlink(missing_ok=True)
        _give_second_name(path, earlier)
    save_learner(path, learner, {"run": _identity(plan, staff), "past": past.record()})
    for old in sorted(plan.folder.glob(EARLIER), reverse=True)[plan.keep - 1 :]:
        old.unlink()


def _give_second_name(path: Path, other: Path) -> None:
    try:
        os.link(path, other)
    except OSError:  # a file system without links
        shutil.copyfile(path, other)


def find_past(plan: Plan, staff: Staff, learner: Learner) -> Past:
    """Put a learner back to the end of a run's last whole iteration; return what else was.

    A run that was stopped before its first checkpoint begins anew. Where the newest checkpoint is
    damaged, the newest whole one of those kept counts.

    Raises:
        CheckpointError: all are damaged, or they are of another run, version or teacher.
    """
    path = plan.folder / CHECKPOINT
    earlier = sorted(plan.folder.glob(EARLIER), reverse=True)
    if not path.is_file() and not earlier:
        return Past()
    problems = []
    for each in (path, *earlier):
        try:
            notes = load_learner(each, learner)
        except CheckpointError as error:
            problems.append(error)
            continue
        _check_identity(each, notes, plan, staff)
        past = Past.of(notes["past"])
        past.notices = [f"{problem}; going on from {each.name}" for problem in problems]
        return past
    raise problems[0]


def _identity(plan: Plan, staff: Staff) -> dict[str, Any]:
    """Return what makes a run this one and no other, as JSON."""
    record = plan.record()
    same = {name: record[name] for name in ("algorithm", "method", "seeds", "task", "transfer")}
    same["task"] = {**same["task"], "ppo": {**same["task"]["ppo"], "n_iterations": None}}
    return same | {"teachers": {str(t["name"]): t["sha256"] for t in staff.record}}


def _check_identity(path: Path, notes: Mapping[str, Any], plan: Plan, staff: Staff) -> None:
    found = difference(notes.get("run"), _identity(plan, staff))
    if found:
        raise CheckpointError(
            f"{path} is of another run than run.json beside it: {found}; put back the one or the "
            "other"
        )


def forget_after(folder: Path, k: int, n_seeds: int) -> None:
    """Remove what a run's folder tells of iterations after k, and files that were never finished.

    Raises:
        CheckpointError: it does not tell of all those before.
        StoreError: it cannot be written.
    """
    cut_csv(folder / "metrics.csv", k, n_seeds)
    evaluations.forget_after(folder, k)
    for unfinished in [*folder.glob(".*-*"), *(folder / evaluations.FOLDER).glob(".*-*")]:
        with suppress(OSError):
            unfinished.unlink()
