"""run.json: what a run is, with what it began and how far it is."""

import json
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    NonNegativeInt,
    PositiveInt,
    ValidationError,
    field_validator,
)

from repaint_cli.errors import CheckpointError, reported_as
from repaint_cli.files.atomic import append_text, as_json, write_text
from repaint_cli.files.limits import read_json
from repaint_cli.runs.folder import RunFolder, remove
from repaint_cli.runs.record_parts import (
    LENIENT,
    Alarm,
    RankedRecord,
    Resumption,
    TeacherRecord,
    or_default,
)
from repaint_cli.settings import MOST_SEEDS, first_problem
from repaint_cli.tasks.methods import ALGORITHMS, METHODS

MOST_ALARMS = 1000
"""Alarms that are recorded at most."""

DECIDED = ("algorithm", "teacher_name", "replace", "keep")
"""Decisions before a run that schema 2 and earlier left out."""

BEGINNING = ("versions", "resumed")
"""What a run began with; results depend on it."""


class RunRecord(BaseModel):
    """All that run.json says; what an earlier schema left out has a default."""

    model_config = ConfigDict(strict=True)

    schema_version: int = 3
    """1 knew one teacher; 2 could not be resumed."""
    state: str = ""
    """running, interrupted, failed or finished."""
    algorithm: str = "ppo"
    """The algorithm, by its name in `methods.ALGORITHMS`."""
    method: str
    """By its name in `methods.METHODS`."""
    seeds: Annotated[list[NonNegativeInt], Field(min_length=1, max_length=MOST_SEEDS)]
    """The run seeds, (S,)."""
    task: dict[str, Any]
    """The target task's card."""
    transfer: dict[str, Any] = {}
    """What the method leaves of the card's transfer settings; for people."""
    teacher_name: str | None = None
    """What the best policy is to be called in the user's zoo, where it is to go there."""
    replace: bool = False
    """Whether it may replace another there."""
    keep: PositiveInt = 1
    """How many checkpoints to keep."""
    device: Annotated[str, Field(pattern="^(cpu|cuda)$")] = "cpu"
    """Where it learns, or learned last."""
    teachers: list[TeacherRecord]
    """The teachers that the run learns from, (M,)."""
    ranked: list[RankedRecord] = []
    """Whom the teacher was chosen among, by what they earned, if it was measured."""
    automatic: bool = False
    """Whether the transfer goes by measurements."""
    versions: dict[str, str] = {}
    """Of the libraries that the run began with."""
    resumed: list[Resumption] = []
    """When the run went on with other versions."""
    reward_file: str | None = None
    """Where the reward function was read, if the reward is one."""
    failure: str = ""
    """How it failed, if that ended the run."""
    mended: list[NonNegativeInt] = []
    """After which iterations the run went on with another text of it."""
    attempt: PositiveInt = 1
    """How many processes have trained it, the last one counted."""
    host: str = ""
    """The machine of the last one."""
    iterations: NonNegativeInt = 0
    """Finished iterations; of a run that trains they may be some seconds old."""
    seconds: float = 0.0
    """How long they took."""
    alarms: list[Alarm] = []
    """What looked wrong, up to the time at which this was written."""

    _lenient = field_validator(
        "schema_version", "state", "transfer", "teacher_name", "replace", "keep", "device",
        "versions", "resumed", "reward_file", "failure", "mended", "iterations", "seconds",
        "alarms", "ranked", "attempt", "host",
        mode="wrap",
    )(or_default)  # fmt: skip

    @field_validator("method", "algorithm")
    @classmethod
    def _check_name(cls, name: str) -> str:
        if name not in {*METHODS, *ALGORITHMS}:
            raise ValueError("expected a method or an algorithm of ours")
        return name

    @field_validator("seeds")
    @classmethod
    def _check_seeds(cls, seeds: list[int]) -> list[int]:
        if len(set(seeds)) < len(seeds):
            raise ValueError("expected every seed once")
        return seeds

    @classmethod
    def read(cls, files: RunFolder) -> "RunRecord":
        """Read what a run is compared by, also of an earlier version; the rest may be malformed.

        Raises:
            CheckpointError: the file is absent or damaged.
        """
        return cls._checked(_json_of(files), files)

    @classmethod
    def read_resumable(cls, files: RunFolder) -> "RunRecord":
        """Read the record of a run that is to go on: nothing may be absent or malformed.

        Raises:
            CheckpointError: the file is absent, damaged or of an earlier version.
        """
        data = _json_of(files)
        cls._checked(data, files)
        try:
            record = cls.model_validate(data)
        except ValidationError as error:
            place = str(error.errors()[0]["loc"][0])
            raise _not_resumable(files, place, first_problem(error)) from error
        if name := record._absent():
            problem = repr(name) if name in BEGINNING else f"{name}: Field required"
            raise _not_resumable(files, name, problem)
        return record

    @classmethod
    def _checked(cls, data: Any, files: RunFolder) -> "RunRecord":
        try:
            return cls.model_validate(data, context=LENIENT)
        except ValidationError as error:
            raise CheckpointError(f"{files.record} is damaged: {first_problem(error)}") from error

    def _absent(self) -> str | None:
        """Name a part that a resumed run needs, and that was left out, as earlier versions did."""
        absent = [name for name in DECIDED if name not in self.model_fields_set]
        for m, teacher in enumerate(self.teachers):
            absent += [f"teachers.{m}.{name}" for name in teacher.absent]
        absent += [name for name in BEGINNING if name not in self.model_fields_set]
        return absent[0] if absent else None

    def write(self, files: RunFolder) -> None:
        """Write the record; the file of new alarms, all of which are in it, is gone then.

        Raises:
            StoreError: run.json cannot be written.
        """
        write_text(files.record, as_json(self.model_dump(mode="json")))
        remove(files.new_alarms)

    def add_alarms(self, alarms: Sequence[Alarm], files: RunFolder) -> None:
        """Take in alarms, as many as there is room for, and put them on disk beside run.json.

        Raises:
            StoreError: the file of new alarms cannot be written.
        """
        new = alarms[: MOST_ALARMS - len(self.alarms)]
        if not new:
            return
        self.alarms.extend(new)
        text = "".join(json.dumps(alarm.model_dump()) + "\n" for alarm in new)
        if files.new_alarms.exists():
            append_text(files.new_alarms, text)
        else:
            write_text(files.new_alarms, text)

    def go_on_with(self, versions: Mapping[str, str]) -> list[str]:
        """Note the versions of a resumed run where they differ; return warnings about them."""
        last = self.resumed[-1].versions if self.resumed else self.versions
        changed = [
            f"{name} {last.get(name)} → {versions.get(name)}"
            for name in sorted(last.keys() | versions.keys())
            if last.get(name) != versions.get(name)
        ]
        if not changed:
            return []
        self.resumed.append(Resumption(after=self.iterations, versions=dict(versions)))
        return [f"the run goes on with other versions ({', '.join(changed)}): not bit for bit"]


def _json_of(files: RunFolder) -> Any:
    """Return run.json as this version would have it.

    Raises:
        CheckpointError: the file is absent, or no JSON.
    """
    with reported_as(CheckpointError):
        data = read_json(files.record)
    if isinstance(data, dict) and data.get("schema_version") == 1:  # which knew one teacher
        data["teachers"] = [data["teacher"]] if data.get("teacher") else []
    return data


def _not_resumable(files: RunFolder, name: str, problem: str) -> CheckpointError:
    if name in BEGINNING:
        return CheckpointError(f"{files.record.name} does not say with what it began: {problem}")
    return CheckpointError(
        f"{files.record} is of an earlier version or damaged, and cannot be resumed: {problem}"
    )
