"""An experiment's own folder: its files, and the record of how they came about."""

import os
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from repaint_cli.errors import CheckpointError, StoreError, reported_as
from repaint_cli.experiments.planned import PlannedExperiment
from repaint_cli.experiments.schema import Experiment
from repaint_cli.files.atomic import as_json, write_text
from repaint_cli.files.limits import read_json
from repaint_cli.files.provenance import versions
from repaint_cli.settings import first_problem
from repaint_cli.threads import cores

CPU_FILE = Path("/proc/cpuinfo")


@dataclass(frozen=True)
class ExperimentFolder:
    """Where each file of an experiment lies."""

    path: Path

    @property
    def record(self) -> Path:
        """What was done, with what and when, as JSON."""
        return self.path / "experiment.json"

    @property
    def curves(self) -> Path:
        """Every evaluation: a row for each panel, variant, seed and iteration."""
        return self.path / "curves.csv"

    @property
    def table(self) -> Path:
        """The numbers beside the paper's, as Markdown."""
        return self.path / "table.md"

    def figure(self, along: str, suffix: str) -> Path:
        """A figure along "iterations" or "steps", or of "trajectories"."""
        return self.path / f"{along}{suffix}"


class ExperimentRecord(BaseModel):
    """What experiment.json says."""

    model_config = ConfigDict(strict=True, extra="ignore")

    schema_version: int = 1
    experiment: str
    """Its name."""
    scale: str
    """smoke, night or paper; what is of the scale smoke is no result."""
    command: str
    """That makes it again."""
    finished: bool
    """Whether all is trained and drawn."""
    definition: dict[str, Any]
    """The experiment as it was read."""
    runs: dict[str, dict[str, str]]
    """The folders of the runs, from here, by panel and variant."""
    seeds: int
    """Of each run, at most."""
    iterations: int
    """Of each run, at most."""
    hours: float
    """That the runs took, one after the other."""
    precision: str
    """Of the networks' arithmetic."""
    hardware: str
    """That it was finished on."""
    versions: dict[str, str]
    """Of the libraries."""
    date: str
    """On which it was finished."""

    @classmethod
    def read(cls, path: Path) -> "ExperimentRecord":
        """Read a record.

        Raises:
            CheckpointError: the file is absent, damaged, or of another version.
        """
        with reported_as(CheckpointError):
            data = read_json(path)
        try:
            record = cls.model_validate(data)
        except ValidationError as error:
            raise CheckpointError(
                f"{path} is damaged or of another version of repaint: {first_problem(error)}"
            ) from error
        if record.schema_version != 1:
            raise CheckpointError(
                f"{path} is of another version of repaint: expected schema_version 1, found "
                f"{record.schema_version}"
            )
        return record

    def is_of(self, experiment: Experiment) -> bool:
        """Return whether the experiment is still defined as it was.

        What an earlier version of repaint did not know has its default, and how long an iteration
        is thought to take defines nothing.
        """
        try:
            before = Experiment.model_validate(self.definition)
        except ValidationError:
            return False
        guessed = {"scales": {"__all__": {"seconds"}}}
        return before.model_dump(exclude=guessed) == experiment.model_dump(exclude=guessed)

    def write(self, path: Path) -> None:
        """Write the record.

        Raises:
            StoreError: it cannot be written.
        """
        write_text(path, as_json(self.model_dump(mode="json")))


def own_folder(planned: PlannedExperiment, replace: bool) -> ExperimentFolder:
    """Return an experiment's folder, and put a record into it before anything is trained.

    An experiment stays the same when its variants, settings or scales are edited. The record of one
    that is finished stays: it says when and where that was.

    Raises:
        StoreError: the folder is another experiment's and may not be replaced, or cannot be made.
        CheckpointError: its record is damaged or of another version.
    """
    folder = ExperimentFolder(planned.folder)
    if folder.record.exists():
        before = ExperimentRecord.read(folder.record)
        same = _about(before.definition) == _about(_definition(planned))
        if not (same or replace):
            raise StoreError(
                f"{folder.path} is of another experiment, "
                f"{before.definition.get('summary')!s:.60}; name another folder with --into, or "
                "--replace it: no run is lost by that"
            )
        done = all(run.left() is None for run in planned.all_runs())
        if before.finished and done and before.is_of(planned.experiment):
            return folder
    elif folder.path.exists() and any(folder.path.iterdir()):
        raise StoreError(f"{folder.path} is there and is no experiment's; name another with --into")
    record_of(planned, finished=False).write(folder.record)
    return folder


def _definition(planned: PlannedExperiment) -> dict[str, Any]:
    return planned.experiment.model_dump(mode="json")


def _about(definition: Mapping[str, Any]) -> list[object]:
    """Return what tells experiments of one name apart: the sentence, and the panels' tasks."""
    panels = [panel.get("task") for panel in definition.get("panels", ())]
    return [definition.get("summary"), definition.get("gathers"), panels]


def record_of(planned: PlannedExperiment, *, finished: bool) -> ExperimentRecord:
    """Return the record of an experiment as it is now.

    Raises:
        CheckpointError: the files of a run are damaged.
    """
    runs = planned.runs()
    recorded = [run.read() for run in planned.all_runs()] if finished else []
    return ExperimentRecord(
        experiment=planned.experiment.name,
        scale=planned.scale,
        command=planned.command(),
        finished=finished,
        definition=_definition(planned),
        runs={
            panel.name_in(planned.experiment): {
                variant: os.path.relpath(run.folder, planned.folder)
                for variant, run in panel.runs.items()
            }
            for panel in planned.panels
        },
        seeds=max(len(run.seeds) for run in runs),
        iterations=max(run.card.ppo.n_iterations for run in runs),
        hours=round(sum(run.record.seconds for run in recorded if run) / 3600, 3),
        precision=str(getattr(runs[0].card.net, "precision", "float32")),
        hardware=hardware(),
        versions=versions(),
        date=datetime.now(UTC).date().isoformat(),
    )


def hardware() -> str:
    """Return the cores that are ours and what they are: "2 cores, Intel Xeon"."""
    n = cores()
    model = platform.processor() or platform.machine()
    if CPU_FILE.exists():
        lines = CPU_FILE.read_text(encoding="utf-8", errors="replace").splitlines()
        named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
        model = named[0] if named else model
    return f"{n} core{'s' * (n != 1)}, {model}"
