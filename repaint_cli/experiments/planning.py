"""From an experiment to its runs: which there are, where they lie, and which are shared.

A run lies in a folder that is named by what defines it (card, method, teachers, seeds). So a run
that several experiments, panels or scales have in common is trained once.
"""

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from repaint_cli.errors import RepaintError, StoreError
from repaint_cli.experiments.cards import card_for
from repaint_cli.experiments.files import read_experiment
from repaint_cli.experiments.schema import Experiment, MadeTeacher, Panel, Scale, Variant
from repaint_cli.files.atomic import sha256
from repaint_cli.runs.folder import RunFolder
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.reader import RecordedRun, read_run
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.card_files import read_task
from repaint_cli.zoo import store

RUNS, TEACHERS = "runs", "teachers"
"""Folders beside those of the experiments."""

KEY = 10
"""Letters of a run's key in its folder's name."""


@dataclass(frozen=True)
class PlannedTeacher:
    """A teacher of a run: a file that is there, or the best policy of a run that comes first."""

    name: str
    file: Path
    key: str
    """What defines it."""
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
        """The SHA-256 of what defines the run."""
        return _key({
            "task": self.card.model_dump(mode="json"), "method": self.method, "seeds": self.seeds,
            "teachers": [teacher.key for teacher in self.teachers],
        })  # fmt: skip

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
        paths = tuple(teacher.file for teacher in self.teachers)
        return Plan(self.card, self.method, list(self.seeds), self.folder, paths)

    def read(self) -> RecordedRun | None:
        """Return what its folder holds, None where there is none.

        Raises:
            CheckpointError: the folder's files are damaged.
            StoreError: the folder is another run's.
        """
        if not RunFolder(self.folder).is_run():
            return None
        run = read_run(self.folder)
        same = run.task == self.card and run.method == self.method
        if not same or run.seeds != list(self.seeds):
            raise StoreError(f"{self.folder} holds another run than its name says; move it away")
        return run

    def left(self) -> int | None:
        """Return how many iterations are left to train; None once all is written.

        Raises:
            As `read`.
        """
        run, wanted = self.read(), self.card.ppo.n_iterations
        done = run.returns.shape[1] if run else 0
        ended = run is not None and run.record.state == "finished"
        return None if ended and done == wanted else wanted - done


@dataclass(frozen=True)
class PlannedPanel:
    """A panel with its runs."""

    experiment: str
    """Whose panel it is."""
    panel: Panel
    runs: dict[str, PlannedRun]
    """By variant."""


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


def plan_experiment(experiment: Experiment, scale: str, root: Path) -> PlannedExperiment:
    """Return an experiment's runs at a scale, in folders below `root`.

    Raises:
        UsageError: the experiment has no such scale, or a setting is no setting.
        NotFound: there is no such task, teacher, setting or experiment.
        CardError: a setting is out of range.
    """
    panels = tuple(_panels(experiment, scale, root))
    return PlannedExperiment(experiment, scale, root, panels)


def _panels(experiment: Experiment, scale: str, root: Path) -> Iterator[PlannedPanel]:
    for name in experiment.gathers:
        other = read_experiment(name)
        if scale in other.scale_names:
            yield from (p for p in _panels(other, scale, root) if p.panel.paper)
    made = {teacher.name: teacher for teacher in experiment.teachers}
    for panel in experiment.panels:
        maker = _Maker(experiment, panel, experiment.scale(scale), root, made)
        runs = {variant.name: maker.run(variant) for variant in experiment.variants_of(panel)}
        yield PlannedPanel(experiment.name, panel, runs)


@dataclass(frozen=True)
class _Maker:
    """Makes the runs of a panel."""

    experiment: Experiment
    panel: Panel
    scale: Scale
    root: Path
    made: dict[str, MadeTeacher]

    def run(self, variant: Variant) -> PlannedRun:
        """Return the run of a variant.

        Raises:
            RepaintError: what is wrong with it; the message says where.
        """
        scale = self.scale
        try:
            card = self._card(self.panel.task, variant.settings, scale.iterations)
            teachers = tuple(self._teacher(name) for name in self.panel.of(variant))
        except RepaintError as error:
            where = f"experiment '{self.experiment.name}', '{variant.name}'"
            raise type(error)(f"{where}: {error}") from error
        seeds = tuple(range(scale.seeds))
        return self._planned(card, variant.method, seeds, teachers)

    def _planned(
        self, card: TaskCard, method: str, seeds: tuple[int, ...],
        teachers: tuple[PlannedTeacher, ...] = (),
    ) -> PlannedRun:  # fmt: skip
        return PlannedRun(card, method, seeds, teachers, self.root / RUNS, self.scale.seconds)

    def _card(self, task: str, settings: Sequence[str], iterations: int) -> TaskCard:
        return card_for(
            read_task(task), self.experiment.preset, self.scale, settings, iterations
        )  # fmt: skip

    def _teacher(self, name: str) -> PlannedTeacher:
        if name not in self.made:
            path = store.find(name)
            return PlannedTeacher(path.stem, path, sha256(path))
        wanted, scale = self.made[name], self.scale
        iterations = scale.teacher_iterations or wanted.iterations
        card = self._card(wanted.task, wanted.settings, iterations)
        seeds = wanted.seeds[: scale.seeds] if scale.short else wanted.seeds
        run = self._planned(card, "scratch", seeds)
        file = self.root / TEACHERS / run.key[:KEY] / f"{name}{store.SUFFIX}"
        return PlannedTeacher(name, file, _key({"best of": run.key, "name": name}), run)


def _key(what: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(what, sort_keys=True).encode()).hexdigest()


def _each_once(runs: Any) -> list[PlannedRun]:
    return list({run.key: run for run in runs}.values())
