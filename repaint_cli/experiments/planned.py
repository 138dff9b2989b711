"""The runs of an experiment as they are planned: what defines each, and where it lies.

A run lies in a folder that is named by what defines it (card, method, teachers, seeds, files of
one's own). So a run that several experiments, panels or scales have in common is trained once.
"""

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from repaint_cli.engines.options import EngineOptions
from repaint_cli.errors import StoreError
from repaint_cli.experiments.schema import Experiment, Panel
from repaint_cli.files.atomic import sha256
from repaint_cli.files.commands import command
from repaint_cli.runs.folder import RunFolder
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.reader import RecordedRun, read_run
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.methods import METHODS
from repaint_cli.zoo.view_names import TeacherFile

INTO = Path("reproduce")
"""Where experiments lie, unless they are put elsewhere."""

KEY = 10
"""Letters of a run's key in its folder's name."""


@dataclass(frozen=True)
class PlannedTeacher:
    """A teacher of a run: a file that is there, or the best policy of a run that comes first."""

    name: str
    file: Path
    key: str
    """What defines it."""
    view: str = ""
    """As in `TeacherFile`."""
    run: "PlannedRun | None" = None
    """Of which it is the best policy, if it is to be made."""


@dataclass(frozen=True)
class PlannedRun:
    """A run of an experiment, trained or not."""

    card: TaskCard
    method: str
    seeds: tuple[int, ...]
    teachers: tuple[PlannedTeacher, ...]
    root: Path
    """The folder of all runs."""
    seconds: float | None
    """About how long an iteration of a seed takes."""

    @property
    def key(self) -> str:
        """The SHA-256 of what defines the run, and of the files of one's own that it reads.

        Settings with their defaults are left out, so that new ones change no key; `read` compares
        all of them.
        """
        files = {name: sha256(path) for name, path in self.card.env.files().items()}
        card = self.card.model_dump(mode="json", exclude_defaults=True, exclude={"summary"})
        defined = {
            "task": card, "method": self.method, "seeds": self.seeds,
            "teachers": [teacher.key for teacher in self.teachers],
        }  # fmt: skip
        return key_of(defined | ({"files": files} if files else {}))

    @property
    def folder(self) -> Path:
        """Where it lies."""
        return self.root / f"{self.card.name}-{self.method}-{self.key[:KEY]}"

    @property
    def label(self) -> str:
        """What it is, for people."""
        names = " and ".join(teacher.name for teacher in self.teachers)
        return f"{self.card.name}, {self.method}" + (f" from {names}" if names else "")

    @property
    def plan(self) -> Plan:
        """What is to be done."""
        files = tuple(TeacherFile(teacher.file, teacher.view) for teacher in self.teachers)
        return Plan(self.card, self.method, list(self.seeds), self.folder, files)

    def read(self) -> RecordedRun | None:
        """Return what its folder holds, None where there is none.

        Raises:
            CheckpointError: the folder's files are damaged.
            StoreError: the folder is another run's.
        """
        if not RunFolder(self.folder).is_run():
            return None
        run = read_run(self.folder)
        card = self._as_settled(run.task).model_copy(update={"summary": run.task.summary})
        same = run.task == card and run.method == self.method
        if not same or run.seeds != list(self.seeds):
            raise StoreError(f"{self.folder} holds another run than its name says; move it away")
        return run

    def _as_settled(self, task: TaskCard) -> TaskCard:
        """Return the card with what was open and is settled in a task: what students start from."""
        if METHODS[self.method].apply(self.card.transfer).start == "untrained":
            return self.card
        net = self.card.net.model_copy(update={"flip_images": task.net.flip_images})
        card = self.card.model_copy(update={"net": net})
        if card.transfer.start != "auto":
            return card
        settled = {name: getattr(task.transfer, name) for name in ("start", "iterations")}
        transfer = card.transfer.model_copy(update=settled)
        ppo = card.ppo.model_copy(update={"max_steps": task.ppo.max_steps})
        return card.model_copy(update={"transfer": transfer, "ppo": ppo})

    def left(self) -> int | None:
        """Return how many iterations are left to train; None once all is written.

        Raises:
            As `read`.
        """
        run, wanted = self.read(), self.card.ppo.n_iterations
        done = run.returns.shape[1] if run else 0
        ended = run is not None and run.record.state == "finished"
        return None if ended and done == wanted else wanted - done

    def pace(self) -> float | None:
        """Return how long its last iteration took, all seeds together; None before the first.

        Raises:
            As `read`.
        """
        run = self.read()
        if run is None or not run.returns.shape[1]:
            return None
        played = sum(one.seconds for one in run.record.ranked)
        return float(np.diff(run.rows["seconds"][0], prepend=played)[-1])


@dataclass(frozen=True)
class PlannedPanel:
    """A panel with its runs."""

    experiment: str
    """Whose panel it is."""
    panel: Panel
    runs: dict[str, PlannedRun]
    """By variant."""

    def name_in(self, experiment: Experiment) -> str:
        """Return what it is called in an experiment, which may gather panels of others."""
        own = experiment.name == self.experiment
        return self.panel.title if own else f"{self.experiment}: {self.panel.title}"


@dataclass(frozen=True)
class PlannedExperiment:
    """An experiment at a scale, with its runs."""

    experiment: Experiment
    scale: str
    root: Path
    """The folder of all experiments."""
    panels: tuple[PlannedPanel, ...]

    @property
    def folder(self) -> Path:
        """The experiment's own folder."""
        return self.root / self.scale / self.experiment.name

    def command(self, scale: str | None = None, options: EngineOptions = EngineOptions()) -> str:  # noqa: B008 - frozen
        """Return the command that carries it out in the same place, perhaps at another scale."""
        form, values = (
            f"repaint reproduce {{}} --scale {scale or self.scale}",
            [self.experiment.file],
        )
        if self.root != INTO:
            form, values = f"{form} --into {{}}", [*values, str(self.root)]
        return command(form, *values) + options.words

    def runs(self) -> list[PlannedRun]:
        """Return all its runs, each once."""
        return _each_once(run for panel in self.panels for run in panel.runs.values())

    def teachers(self) -> list[PlannedTeacher]:
        """Return the teachers that are to be made, each once."""
        made = (teacher for run in self.runs() for teacher in run.teachers if teacher.run)
        return list({teacher.key: teacher for teacher in made}.values())

    def all_runs(self) -> list[PlannedRun]:
        """Return all runs, those of teachers first."""
        return _each_once([*(t.run for t in self.teachers() if t.run), *self.runs()])


def key_of(what: dict[str, Any]) -> str:
    """Return the SHA-256 of what defines something."""
    return hashlib.sha256(json.dumps(what, sort_keys=True).encode()).hexdigest()


def _each_once(runs: Iterable[PlannedRun]) -> list[PlannedRun]:
    return list({run.key: run for run in runs}.values())
