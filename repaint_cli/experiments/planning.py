"""From an experiment to its runs: which there are, and with which cards and teachers."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from repaint_cli.errors import CardError, RepaintError
from repaint_cli.experiments.cards import card_for
from repaint_cli.experiments.files import read_experiment
from repaint_cli.experiments.planned import (
    KEY,
    PlannedExperiment,
    PlannedPanel,
    PlannedRun,
    PlannedTeacher,
    key_of,
)
from repaint_cli.experiments.schema import Experiment, MadeTeacher, Panel, Scale, Variant
from repaint_cli.files.atomic import sha256
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.card_files import read_task
from repaint_cli.tasks.methods import METHODS
from repaint_cli.tasks.presets import automatic
from repaint_cli.zoo import store, view_names
from repaint_cli.zoo.teacher_card import read_card
from repaint_cli.zoo.views import as_warm_started

RUNS, TEACHERS = "runs", "teachers"
"""Folders beside those of the experiments."""


def plan_experiment(experiment: Experiment, scale: str, root: Path) -> PlannedExperiment:
    """Return an experiment's runs at a scale, in folders below `root`.

    Raises:
        UsageError: the experiment has no such scale, or a setting is no setting.
        NotFound: there is no such task, teacher, setting or experiment.
        CardError: a setting is out of range, or the experiment has nothing to train.
    """
    panels = tuple(_panels(experiment, scale, root))
    if not panels:
        raise CardError(
            f"experiment '{experiment.name}' gathers no panel at the scale {scale}: expected "
            "others that have the scale and numbers of the paper"
        )
    return PlannedExperiment(experiment, scale, root, panels)


def _panels(experiment: Experiment, scale: str, root: Path) -> Iterator[PlannedPanel]:
    for name in experiment.gathers:
        other = read_experiment(name)
        if other.gathers:
            raise CardError(
                f"experiment '{experiment.name}' gathers '{name}', which gathers others; name those"
            )
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
            names: Sequence[str] = self.panel.of(variant)
            if variant.auto:
                by_hand = [*scale.settings, *variant.settings]
                card = automatic(card, by_hand, "ppo", variant.method)
                names = view_names.in_view(names, view_names.AUTO)
            teachers = tuple(self._teacher(name) for name in names)
            starts = METHODS[variant.method].apply(card.transfer).start == "teacher"
            if starts and teachers[0].view != view_names.AUTO:  # which is settled when it begins
                card = _as_warm_started(card, teachers[0])
        except RepaintError as error:
            where = f"experiment '{self.experiment.name}', '{variant.name}'"
            raise type(error)(f"{where}: {error}") from error
        seeds = tuple(range(scale.first_seed, scale.first_seed + scale.seeds))
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

    def _teacher(self, typed: str) -> PlannedTeacher:
        name, view = view_names.split(typed)
        if name not in self.made:
            path = store.find(name)
            key = view_names.with_view(sha256(path), view)
            return PlannedTeacher(view_names.with_view(path.stem, view), path, key, view)
        wanted, scale = self.made[name], self.scale
        iterations = scale.teacher_iterations or wanted.iterations
        card = self._card(wanted.task, wanted.settings, iterations)
        seeds = wanted.seeds[: scale.seeds] if scale.short else wanted.seeds
        run = self._planned(card, "scratch", seeds)
        file = self.root / TEACHERS / run.key[:KEY] / f"{name}{store.SUFFIX}"
        key = view_names.with_view(key_of({"best of": run.key, "name": name}), view)
        return PlannedTeacher(view_names.with_view(name, view), file, key, view, run)


def _as_warm_started(card: TaskCard, teacher: PlannedTeacher) -> TaskCard:
    """Return the card of a student that starts from a teacher, which may still have to be made."""
    own = teacher.run.card if teacher.run else read_card(teacher.file).task
    return as_warm_started(card, teacher.file.stem, own, teacher.view)
