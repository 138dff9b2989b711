"""What a run has behind it: claimed once, put on disk with every iteration, found again."""

import os
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from repaint_cli.envs.racer.deepracer.simtrace import START
from repaint_cli.envs.simulator import RacerEnv
from repaint_cli.errors import CheckpointError, StoreError
from repaint_cli.files.atomic import (
    UMASK,
    UNFINISHED,
    as_json,
    sha256,
    write_text,
    written_to,
    written_whole,
)
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.transfer.course import Course
from repaint_cli.runs import evaluations
from repaint_cli.runs.alarms import IN_A_ROW, Alarm
from repaint_cli.runs.checkpoint import load_learner, save_learner
from repaint_cli.runs.metrics import cut_csv, start_csv
from repaint_cli.runs.plan import Plan, difference
from repaint_cli.runs.teachers import Staff

CHECKPOINT = "checkpoint.safetensors"
"""All that the learner is after the last finished iteration."""

EARLIER = "checkpoint-*.safetensors"
"""Those before it, by iteration."""

MOST_ALARMS = 1000
"""Alarms that are recorded: what has to be said so often need not be said more often."""


@dataclass
class Past:
    """What the run remembers beside its learner."""

    seconds: float = 0.0
    """How long it has taken."""
    best_return: float = float("-inf")
    """Of the best evaluated policy so far."""
    best: tuple[int, int] = (0, 0)
    """After which iteration it was, and which of the seeds, from 0."""
    alarms: list[Alarm] = field(default_factory=list)
    """What looked wrong."""
    returns: list[np.ndarray] = field(default_factory=list)
    """Evaluated returns (S, E) after the last iterations, as many as alarms look back."""
    logs: list[Mapping[str, float]] = field(default_factory=list)
    """How far each seed's log of its drives is."""
    notices: list[str] = field(default_factory=list)
    """What was wrong with how it was found."""
    source: Path | None = None
    """The checkpoint it was found in."""

    def see(self, k: int, returns: np.ndarray, alarms: Sequence[Alarm]) -> None:
        """Take in iteration k: how its evaluation went (S, E), and what looked wrong."""
        self.returns = [*self.returns, returns][1 - IN_A_ROW :]
        self.alarms = [*self.alarms, *alarms][:MOST_ALARMS]
        means = returns.mean(1)
        s = int(means.argmax())
        if means[s] > self.best_return:
            self.best_return, self.best = float(means[s]), (k, s)

    def record(self) -> dict[str, Any]:
        """Return it as JSON."""
        return {
            "seconds": self.seconds,
            "best_return": self.best_return,
            "best": self.best,
            "alarms": [alarm.record() for alarm in self.alarms],
            "returns": [returns.tolist() for returns in self.returns],
            "logs": self.logs,
        }

    @classmethod
    def of(cls, notes: Mapping[str, Any], source: Path) -> "Past":
        """Return what `record` told.

        Raises:
            CheckpointError: it did not.
        """
        try:
            record = notes["past"]
            k, s = map(int, record["best"])
            return cls(
                seconds=float(record["seconds"]),
                best_return=float(record["best_return"]),
                best=(k, s),
                alarms=[Alarm(**alarm) for alarm in record["alarms"]],
                returns=[np.array(returns, np.float64) for returns in record["returns"]],
                logs=[{name: float(log[name]) for name in START} for log in record["logs"]],
                source=source,
            )
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
            raise CheckpointError(f"{source} tells nothing of its past: {error!s:.200}") from error


def claim(folder: Path, record: Mapping[str, Any]) -> None:
    """Make the folder of a new run, with its record and no metrics, at one stroke.

    Raises:
        StoreError: it exists or cannot be made.
    """
    if folder.exists():
        raise StoreError(f"{folder} exists already; name another with --run, or --resume it")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        beginning = Path(tempfile.mkdtemp(dir=folder.parent, prefix=UNFINISHED))
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


def save_checkpoint(plan: Plan, staff: Staff, learner: Learner, course: Course, past: Past) -> None:
    """Write all that the run is after an iteration; keep as many earlier ones as asked.

    Raises:
        StoreError: it cannot be written; the one before is as it was.
    """
    path = plan.folder / CHECKPOINT
    if plan.keep > 1 and path.is_file():
        _copy(path, plan.folder / EARLIER.replace("*", f"{learner.iteration - 1:05}"))
    save_learner(path, learner, course, {"run": _identity(plan, staff), "past": past.record()})
    for old in _earlier(plan.folder)[plan.keep - 1 :]:
        _remove(old)


def _copy(path: Path, other: Path) -> None:
    """Put a file in the place of another, too; it takes no room where there are links."""
    with written_whole(other) as temporary:
        temporary.unlink()
        try:
            os.link(path, temporary)
        except OSError:
            shutil.copyfile(path, temporary)


def _earlier(folder: Path) -> list[Path]:
    """Return the checkpoints before the last, the newest first."""
    return sorted(folder.glob(EARLIER), reverse=True)


def _remove(path: Path) -> None:
    with written_to(path):
        path.unlink(missing_ok=True)


def find_past(plan: Plan, staff: Staff, learner: Learner, course: Course) -> Past:
    """Put a learner and its course back to a run's last whole iteration; return what else was.

    A run that was stopped before its first checkpoint begins anew. Where the newest checkpoint is
    damaged, the newest whole one of those kept counts.

    Raises:
        CheckpointError: all are damaged, or they are of another run, version or teacher.
    """
    path = plan.folder / CHECKPOINT
    earlier = _earlier(plan.folder)
    if not path.is_file() and not earlier:
        return Past()
    problems = []
    for each in (path, *earlier):
        try:
            notes = load_learner(each, learner, course)
            past = Past.of(notes, each)
        except CheckpointError as error:
            problems.append(error)
            continue
        _check_identity(each, notes, plan, staff)
        past.notices = [f"{problem}; going on from {each.name}" for problem in problems]
        return past
    raise problems[0]


def _identity(plan: Plan, staff: Staff) -> dict[str, Any]:
    """Return what makes a run this one and no other, as JSON."""
    record = plan.record()
    same = {name: record[name] for name in ("algorithm", "method", "seeds", "task", "transfer")}
    same["task"] = {**same["task"], "ppo": {**same["task"]["ppo"], "n_iterations": None}}
    teachers = {str(teacher["name"]): teacher["sha256"] for teacher in staff.record}
    track = plan.task.env.track if isinstance(plan.task.env, RacerEnv) else ""
    own = sha256(Path(track)) if track.endswith(".npy") else None
    return same | {"teachers": teachers, "track": own}


def _check_identity(path: Path, notes: Mapping[str, Any], plan: Plan, staff: Staff) -> None:
    found = difference(notes.get("run"), _identity(plan, staff))
    if found:
        raise CheckpointError(
            f"{path} is of another run than run.json beside it: {found}; put back the one or the "
            "other"
        )


def settle(folder: Path, past: Past, k: int, n_seeds: int) -> None:
    """Remove what a run's folder tells of iterations after k, and what was never finished.

    Raises:
        CheckpointError: it does not tell of all those before.
        StoreError: it cannot be written.
    """
    newest = folder / CHECKPOINT
    if past.source and past.source != newest:  # which is damaged
        _copy(past.source, newest)
    for path in _earlier(folder):
        if path.name >= EARLIER.replace("*", f"{k:05}"):
            _remove(path)
    cut_csv(folder / "metrics.csv", k, n_seeds)
    evaluations.forget_after(folder, k)
    for unfinished in folder.rglob(f"{UNFINISHED}*"):
        _remove(unfinished)
