"""What is decided before a run starts, and as run.json keeps it for whoever resumes it."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import BaseModel, PositiveInt, ValidationError

from repaint_cli.errors import CheckpointError, NotFound, TeacherMismatch
from repaint_cli.files.atomic import sha256
from repaint_cli.settings import TransferConfig, first_problem
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.methods import METHODS
from repaint_cli.zoo import store


@dataclass(frozen=True)
class Plan:
    """All that is decided before a run starts."""

    task: TaskCard
    method: str
    seeds: list[int]
    folder: Path
    teachers: tuple[Path, ...] = ()
    acting: tuple[Path, ...] | None = None
    """Those whose own samples are learned from; all of them where absent."""
    algorithm: str = "ppo"
    """Who learns, by its name in `methods.ALGORITHMS`."""
    teacher_name: str | None = None
    """What the best evaluated policy is to be called in the user's zoo, if it is to go there."""
    replace: bool = False
    """Whether it may replace another there."""
    keep: int = 1
    """How many checkpoints to keep."""

    @property
    def transfer(self) -> TransferConfig:
        """What the method leaves of the task's transfer settings."""
        return METHODS[self.method].apply(self.task.transfer)

    @property
    def target(self) -> TaskCard:
        """The task as the method and the algorithm carry it out."""
        transfer, select = self.transfer, self.task.select
        if self.algorithm != "ppo":
            transfer = transfer.model_copy(update={"phases": "ratio"})
        if select.rule == "auto" and (self.algorithm != "ppo" or not transfer.instance):
            select = select.model_copy(update={"rule": "zeta"})
        return self.task.model_copy(update={"transfer": transfer, "select": select})

    def record(self) -> dict[str, Any]:
        """Return it as JSON, but for the teachers, whose files are known when they are loaded."""
        return {
            "algorithm": self.algorithm,
            "method": self.method,
            "seeds": self.seeds,
            "task": self.task.model_dump(mode="json"),
            "transfer": self.transfer.model_dump(mode="json"),
            "teacher_name": self.teacher_name,
            "replace": self.replace,
            "keep": self.keep,
        }

    def for_iterations(self, n: int) -> "Plan":
        """Return it with another number of iterations; nothing else depends on that."""
        return replace(self, task=self.task.with_settings([f"ppo.n_iterations={n}"]))


def plan_of(record: Mapping[str, Any], task: TaskCard, folder: Path) -> Plan:
    """Return the plan of an earlier run, with its teachers' files found again.

    Args:
        record: its run.json.
        task: the task in it.
        folder: where it lies.

    Raises:
        CheckpointError: the record is of an earlier version.
        NotFound: a teacher is gone.
        TeacherMismatch: a teacher's file is another one now.
    """
    try:
        begun = _Begun.model_validate(record)
    except ValidationError as error:
        raise CheckpointError(
            f"{folder}/run.json is of an earlier version or damaged, and cannot be resumed: "
            f"{first_problem(error)}"
        ) from error
    found = [(_file_of(teacher), teacher.instances) for teacher in begun.teachers]
    return Plan(
        task, begun.method, begun.seeds, folder,
        teachers=tuple(path for path, _ in found),
        acting=tuple(path for path, acts in found if acts),
        algorithm=begun.algorithm, teacher_name=begun.teacher_name,
        replace=begun.replace, keep=begun.keep,
    )  # fmt: skip


class _Named(BaseModel):
    """A teacher in run.json."""

    name: str
    sha256: str
    instances: bool
    file: str


class _Begun(BaseModel):
    """What of run.json a resumed run needs."""

    method: str
    algorithm: str
    seeds: list[int]
    teachers: list[_Named]
    teacher_name: str | None
    replace: bool
    keep: PositiveInt


def _file_of(teacher: _Named) -> Path:
    """Return a teacher's file: where it was, or in the zoo; its contents must be the same."""
    name, wanted = teacher.name, teacher.sha256
    known = store.teachers()
    places = [Path(teacher.file), *([known[name]] if name in known else [])]
    hashes = {path: sha256(path) for path in places if path.is_file()}
    if not hashes:
        raise NotFound(
            f"the run's teacher '{name}' is gone: expected it at {places[0]} or in the zoo"
        )
    for path, found in hashes.items():
        if found == wanted:
            return path
    path, found = next(iter(hashes.items()))
    raise TeacherMismatch(
        f"the run's teacher '{name}' was {wanted[:12]}… (sha256), {path} is {found[:12]}…; "
        "put the file that it began with in place"
    )


def difference(theirs: Any, ours: Any, where: Sequence[str] = ()) -> str | None:
    """Return the first place in which two JSON values differ, with both, or None."""
    if isinstance(theirs, Mapping) and isinstance(ours, Mapping):
        for name in sorted(theirs.keys() | ours.keys()):
            found = difference(theirs.get(name), ours.get(name), (*where, name))
            if found:
                return found
        return None
    if theirs == ours:
        return None
    return f"{'.'.join(where)} {json.dumps(theirs)} against {json.dumps(ours)}"
