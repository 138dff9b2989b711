"""What is decided before a run starts, and is read from run.json when it is resumed."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from repaint_cli.errors import CardError, NotFound, TeacherMismatch, UsageError
from repaint_cli.files.atomic import sha256
from repaint_cli.files.commands import command
from repaint_cli.files.provenance import versions
from repaint_cli.learn import q_learning
from repaint_cli.learn.evaluation import spaces_of
from repaint_cli.policies.spaces import Spaces
from repaint_cli.runs.folder import RunFolder
from repaint_cli.runs.record import RunRecord
from repaint_cli.runs.record_parts import RankedRecord, TeacherRecord
from repaint_cli.runs.teachers import RunTeachers, load_teachers
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.methods import METHODS
from repaint_cli.tasks.transfer_settings import TransferConfig
from repaint_cli.zoo import sent, store
from repaint_cli.zoo.view_names import TeacherFile


@dataclass(frozen=True)
class Plan:
    """All that is decided before a run starts."""

    task: TaskCard
    method: str
    seeds: list[int]
    folder: Path
    """Of the run; where it is `numbered`, `owner.new_run` knows the one that it got."""
    teachers: tuple[TeacherFile, ...] = ()
    acting: tuple[TeacherFile, ...] | None = None
    """Those whose own samples are learned from; all of them where absent."""
    algorithm: str = "ppo"
    """The algorithm, by its name in `methods.ALGORITHMS`."""
    teacher_name: str | None = None
    """What the best evaluated policy is to be called in the user's zoo, if it is to go there."""
    replace: bool = False
    """Whether it may replace another there."""
    keep: int = 1
    """How many checkpoints to keep."""
    device: str = "cpu"
    """Where it learns: "cpu" or "cuda"."""
    numbered: bool = False
    """Whether a number is added to the folder's name where it is taken."""
    ranked: tuple[RankedRecord, ...] = ()
    """Whom the teacher was chosen among, if it was measured; the steps of that count."""
    begun: RunRecord | None = None
    """The record of a run that goes on; None of a new one."""
    notices: tuple[str, ...] = ()
    """Warnings about a run that goes on."""
    mended: bool = False
    """Whether its reward function has another text than before."""

    @property
    def files(self) -> RunFolder:
        """Where the run's files lie."""
        return RunFolder(self.folder)

    @property
    def transfer(self) -> TransferConfig:
        """What the method leaves of the task's transfer settings."""
        transfer = METHODS[self.method].apply(self.task.transfer)
        if self.algorithm == "ppo":
            return transfer
        return transfer.model_copy(update={"phases": "ratio", "start": "untrained"})

    @property
    def target(self) -> TaskCard:
        """The task as the method and the algorithm carry it out."""
        transfer, select = self.transfer, self.task.select
        if select.rule == "auto" and (self.algorithm != "ppo" or not transfer.instance):
            select = select.model_copy(update={"rule": "zeta"})
        return self.task.model_copy(update={"transfer": transfer, "select": select})

    def check(self) -> tuple[Spaces, RunTeachers]:
        """Check what would otherwise fail only in the run; return the spaces and the teachers.

        Raises:
            CardError: the task cannot be rolled out as its card says, or the number of teachers
                and the settings do not go together.
            TeacherMismatch: a teacher does not fit the task.
            NotFound: the task has no such view of a teacher.
            CheckpointError: a teacher's file is damaged.
            UsageError: no checkpoint would be kept.
        """
        if self.keep < 1:
            raise UsageError(f"expected at least 1 checkpoint to keep, found {self.keep}")
        task = self.target
        spaces = spaces_of(task)
        task.check_symmetry(spaces)
        task.check_rollout()
        check_automatic(task)
        by_q = self.algorithm == "q-learning"
        if by_q:
            q_learning.check_actions(task, spaces)
        files = self.teachers if METHODS[self.method].needs_teacher else ()
        seeds = len(self.seeds)
        return spaces, load_teachers(files, self.acting, task, spaces, seeds, student_acts=by_q)

    def new_record(self, teachers: RunTeachers) -> RunRecord:
        """Return the record of the run at its beginning."""
        code, begun = self.task.reward_code, self.begun
        return RunRecord(
            state="running",
            algorithm=self.algorithm,
            method=self.method,
            seeds=self.seeds,
            task=self.task.model_dump(mode="json"),
            transfer=self.transfer.model_dump(mode="json"),
            teacher_name=self.teacher_name,
            replace=self.replace,
            keep=self.keep,
            device=self.device,
            teachers=list(teachers.records),
            ranked=list(self.ranked),
            automatic=self.target.automatic and bool(teachers.teachers),
            versions=versions(),
            reward_file=(code.file if code else None) or (begun.reward_file if begun else None),
            mended=list(begun.mended) if begun else [],
        )

    def identity(self, teachers: RunTeachers) -> dict[str, Any]:
        """Return what identifies a run, as JSON.

        The number of iterations is no part of it, nor is the text of a reward function, which may
        have been mended.
        """
        task = self.task.model_dump(mode="json")
        task["ppo"]["n_iterations"] = None
        without_text(task)
        return {
            "algorithm": self.algorithm,
            "method": self.method,
            "seeds": self.seeds,
            "task": task,
            "transfer": self.transfer.model_dump(mode="json"),
            "teachers": {teacher.label: teacher.sha256 for teacher in teachers.records},
            **{name: sha256(path) for name, path in self.task.env.files().items()},
        }

    @property
    def resume_command(self) -> str:
        """The command that goes on with the run."""
        verb = "transfer" if self.teacher_name is None else "train-teacher"
        return command(f"repaint {verb} --resume {{}}", self.folder)

    def as_new(self) -> "Plan":
        """Return the plan of the same run before it began."""
        return replace(self, begun=None)

    def for_iterations(self, n: int) -> "Plan":
        """Return the plan with another number of iterations."""
        return replace(self, task=self.task.with_settings([f"ppo.n_iterations={n}"]))


def without_text(task: dict[str, Any]) -> None:
    """Take the text of a reward function out of a task in JSON; its name stays."""
    if isinstance(code := task.get("reward_code"), Mapping):
        task["reward_code"] = {**code, "source": None}


def check_automatic(task: TaskCard) -> None:
    """Check that evaluations, by which an automatic transfer may go, have a standard error.

    Raises:
        CardError: an evaluation has one episode.
    """
    if task.automatic and task.eval.episodes < 2:
        raise CardError(
            "expected at least 2 episodes per evaluation where the transfer is automatic, found "
            f"{task.eval.episodes}; try --eval-episodes 5, or --method repaint"
        )


def plan_of(record: RunRecord, task: TaskCard, folder: Path) -> Plan:
    """Return the plan of a run that goes on, with the files of its teachers.

    Args:
        record: its run.json.
        task: the task in it.
        folder: where it lies.

    Raises:
        NotFound: a teacher's file is gone.
        TeacherMismatch: a teacher's file has other contents now.
    """
    files = [
        (TeacherFile(_file_of(teacher), teacher.view), teacher.instances)
        for teacher in record.teachers
    ]
    return Plan(
        task, record.method, record.seeds, folder,
        teachers=tuple(file for file, _ in files),
        acting=tuple(file for file, acts in files if acts),
        ranked=tuple(record.ranked), algorithm=record.algorithm, teacher_name=record.teacher_name,
        replace=record.replace, keep=record.keep, device=record.device, begun=record,
    )  # fmt: skip


def _file_of(teacher: TeacherRecord) -> Path:
    """Return a teacher's file: where it was, or in the zoo; its contents must be the same.

    Raises:
        NotFound: there is no file in either place.
        TeacherMismatch: the files there have other contents.
    """
    name, wanted = teacher.name, teacher.sha256
    known = store.teachers()
    others = (name, f"{name}{store.SHIPPED}")
    places = [Path(teacher.file), *(known[other] for other in others if other in known)]
    places += [path] if (path := sent.sent_file(wanted)) else []
    hashes = {path: sha256(path) for path in places if path.is_file()}
    if not hashes:
        raise NotFound(
            f"the run's teacher '{name}' is gone: expected it at {places[0]} or in the zoo"
        )
    for path, actual in hashes.items():
        if actual == wanted:
            return path
    path, actual = next(iter(hashes.items()))
    raise TeacherMismatch(
        f"the run's teacher '{name}' was {wanted[:12]}… (sha256), {path} is {actual[:12]}…; "
        "put the file that it began with in place"
    )


def difference(earlier: Any, present: Any, where: Sequence[str] = ()) -> str | None:
    """Return the first place in which two JSON values differ, with both, or None."""
    if isinstance(earlier, Mapping) and isinstance(present, Mapping):
        for name in sorted(earlier.keys() | present.keys()):
            text = difference(earlier.get(name), present.get(name), (*where, name))
            if text:
                return text
        return None
    if earlier == present:
        return None
    return f"{'.'.join(where)} {json.dumps(earlier)} against {json.dumps(present)}"
