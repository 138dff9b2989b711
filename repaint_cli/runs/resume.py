"""The state of a run beside its learner: written with every iteration, and read when resumed."""

import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from repaint_cli.errors import CheckpointError
from repaint_cli.files.atomic import atomic_write
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.transfer.course import Course
from repaint_cli.runs.alarms import IN_A_ROW
from repaint_cli.runs.checkpoint import load_learner, save_learner
from repaint_cli.runs.folder import remove
from repaint_cli.runs.metrics import cut_csv
from repaint_cli.runs.plan import Plan, difference
from repaint_cli.runs.teachers import RunTeachers


@dataclass
class RunState:
    """The state of a run beside its learner; its size does not grow with the iterations."""

    seconds: float = 0.0
    """How long the run has taken."""
    best_return: float = float("-inf")
    """Mean return of the best evaluated policy so far."""
    best: tuple[int, int] = (0, 0)
    """After which iteration it was evaluated, and which of the seeds it is, from 0."""
    returns: list[np.ndarray] = field(default_factory=list)
    """Evaluated returns (S, E) after the last iterations, as many as alarms look back."""
    logs: list[Mapping[str, float]] = field(default_factory=list)
    """How far each seed's log of its episodes is."""
    notices: list[str] = field(default_factory=list)
    """Warnings from reading it."""
    source: Path | None = None
    """The checkpoint that it was read from."""

    def add_evaluation(self, k: int, returns: np.ndarray) -> None:
        """Take in the evaluated returns (S, E) after iteration k."""
        self.returns = [*self.returns, returns][1 - IN_A_ROW :]
        means = returns.mean(1)
        s = int(means.argmax())
        if means[s] > self.best_return:
            self.best_return, self.best = float(means[s]), (k, s)

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON."""
        return {
            "seconds": self.seconds,
            "best_return": self.best_return,
            "best": self.best,
            "returns": [returns.tolist() for returns in self.returns],
            "logs": self.logs,
        }

    @classmethod
    def from_notes(cls, notes: Mapping[str, Any], source: Path) -> "RunState":
        """Return the state in a checkpoint's notes, as `as_json` wrote it.

        Raises:
            CheckpointError: a part is absent or malformed.
        """
        try:
            past = notes["past"]
            k, s = map(int, past["best"])
            return cls(
                seconds=float(past["seconds"]),
                best_return=float(past["best_return"]),
                best=(k, s),
                returns=[np.array(returns, np.float64) for returns in past["returns"]],
                logs=[{str(n): float(x) for n, x in log.items()} for log in past["logs"]],
                source=source,
            )
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
            raise CheckpointError(f"{source} tells nothing of its past: {error!s:.200}") from error


def save_checkpoint(
    plan: Plan, teachers: RunTeachers, learner: Learner, course: Course, state: RunState
) -> None:
    """Write all that the run is after an iteration; keep as many earlier ones as planned.

    Raises:
        StoreError: the checkpoint cannot be written; the earlier checkpoint is as it was.
    """
    files, k = plan.files, learner.iteration
    if plan.keep > 1 and files.checkpoint.is_file():
        _copy(files.checkpoint, files.earlier_checkpoint(k - 1))
    notes = {"run": plan.identity(teachers), "past": state.as_json()}
    save_learner(files.checkpoint, learner, course, notes)
    if plan.keep > 1:
        remove(files.earlier_checkpoint(k - plan.keep))


def _copy(path: Path, other: Path) -> None:
    """Put a file in the place of another, too; it takes no room where there are links.

    Raises:
        StoreError: the copy cannot be written.
    """
    with atomic_write(other) as temporary:
        temporary.unlink()
        try:
            os.link(path, temporary)
        except OSError:
            shutil.copyfile(path, temporary)


def restore(plan: Plan, teachers: RunTeachers, learner: Learner, course: Course) -> RunState:
    """Restore a learner and its course after a run's last whole iteration; return the rest.

    A run that was stopped before its first checkpoint starts anew. Where the newest checkpoint is
    damaged, the newest whole one of those kept counts.

    Raises:
        CheckpointError: all checkpoints are damaged, or of another run, version or teacher.
    """
    newest, earlier = plan.files.checkpoint, plan.files.earlier_checkpoints()
    if not newest.is_file() and not earlier:
        learner.iteration = 0
        return RunState()
    problems = []
    for path in (newest, *earlier.values()):
        try:
            notes = load_learner(path, learner, course)
            state = RunState.from_notes(notes, path)
        except CheckpointError as error:
            problems.append(error)
            continue
        _check_identity(path, notes, plan, teachers)
        state.notices = [f"{problem}; going on from {path.name}" for problem in problems]
        return state
    raise problems[0]


def _check_identity(
    path: Path, notes: Mapping[str, Any], plan: Plan, teachers: RunTeachers
) -> None:
    """Check that a checkpoint is of the planned run.

    Raises:
        CheckpointError: the checkpoint is of another run.
    """
    text = difference(notes.get("run"), plan.identity(teachers))
    if text:
        raise CheckpointError(
            f"{path} is of another run than run.json beside it: {text}; put back the one or the "
            "other"
        )


def settle(plan: Plan, state: RunState, k: int) -> None:
    """Remove what a run's folder holds of iterations after k, and what was never finished.

    Raises:
        CheckpointError: metrics.csv lacks an iteration up to k.
        StoreError: the folder cannot be written.
    """
    files = plan.files
    if state.source and state.source != files.checkpoint:  # which is damaged
        _copy(state.source, files.checkpoint)
    files.forget_after(k)
    for surplus in list(files.earlier_checkpoints().values())[plan.keep - 1 :]:
        remove(surplus)
    cut_csv(files.metrics, k, len(plan.seeds))
    files.remove_unfinished()
