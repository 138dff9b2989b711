"""Reproduce an experiment: plan, train what is left, draw, table, record."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from repaint_cli.engines.engine import RunsFailed
from repaint_cli.engines.options import EngineOptions
from repaint_cli.engines.root import driven
from repaint_cli.experiments.estimates import seconds_left
from repaint_cli.experiments.figures import draw
from repaint_cli.experiments.folder import ExperimentFolder, ExperimentRecord, own_folder, record_of
from repaint_cli.experiments.measures import MeasuredRow, over_panels, rows_of
from repaint_cli.experiments.planned import INTO, PlannedExperiment
from repaint_cli.experiments.planning import plan_experiment
from repaint_cli.experiments.results import measured, write_curves
from repaint_cli.experiments.schema import Experiment
from repaint_cli.experiments.tables import (
    MEANING,
    MORE,
    markdown,
    nobody_reached,
    over_markdown,
)
from repaint_cli.experiments.training import TrainingWatcher, train, unfinished
from repaint_cli.files.atomic import write_text
from repaint_cli.runs.aggregate import Aggregated


@dataclass(frozen=True)
class Remaining:
    """What an experiment would train now."""

    planned: PlannedExperiment
    left: int
    """Runs that are not finished."""
    seconds: float
    """About how long these take."""


@dataclass(frozen=True)
class Reproduced:
    """An experiment that is trained, drawn and tabled."""

    planned: PlannedExperiment
    rows: list[MeasuredRow]
    """Our numbers beside the paper's."""
    over: dict[str, Aggregated]
    """Of an experiment that gathers others: each variant's numbers over all panels."""
    warnings: list[str]
    """What its numbers cannot say."""
    written: list[Path]
    """Its files, without those of its runs."""


class ExperimentWatcher(TrainingWatcher):
    """Follows experiments; this base class does nothing."""

    def begin(self, remaining: Sequence[Remaining]) -> None:
        """All is checked; this is what will be trained."""

    def finish(self, reproduced: Reproduced) -> None:
        """An experiment is done."""


def reproduce(
    experiments: Sequence[Experiment],
    scale: str,
    into: Path = INTO,
    jobs: int | EngineOptions = 1,
    watcher: ExperimentWatcher | None = None,
    replace: bool = False,
) -> list[Reproduced]:
    """Carry out experiments at a scale; what has been trained is not trained again.

    Args:
        experiments: in the order in which they are carried out.
        scale: "smoke", "night" or "paper".
        into: the folder of all experiments and of the runs that they share.
        jobs: how many runs train at a time, or the options of an engine.
        watcher: follows them.
        replace: whether folders of other experiments of the same names may be written.

    Raises:
        RepaintError: an experiment cannot be planned.
        Locked: another command trains an experiment.
        RunsFailed: some runs failed; finished ones stay, and so do other experiments.
    """
    watcher = watcher or ExperimentWatcher()
    options = EngineOptions.of(jobs)
    planned = [plan_experiment(one, scale, into) for one in experiments]
    folders = [own_folder(one, replace) for one in planned]
    watcher.begin(remaining(planned))
    reproduced, failures = list[Reproduced](), list[RunsFailed]()
    with options.open(watcher) as engine:
        for one, folder in zip(planned, folders, strict=True):
            try:
                with driven(folder.path, engine.driver):
                    train(one, engine, options, watcher)
            except RunsFailed as error:
                failures.append(error)
                continue
            reproduced.append(_carried_out(one, folder, watcher))
    if failures:
        raise RunsFailed("; ".join(map(str, failures))) from failures[0].__cause__
    return reproduced


def remaining(planned: Sequence[PlannedExperiment]) -> list[Remaining]:
    """Return what experiments would train one after the other; shared runs count for the first.

    Raises:
        RepaintError: see `seconds_left`.
    """
    seen, left = set[str](), []
    for one in planned:
        new = [run for run in unfinished(one) if run.key not in seen]
        seen |= {run.key for run in new}
        left.append(Remaining(one, len(new), seconds_left(new)))
    return left


def _carried_out(
    planned: PlannedExperiment, folder: ExperimentFolder, watcher: ExperimentWatcher
) -> Reproduced:
    panels = measured(planned)
    rows = [row for panel in panels for row in rows_of(panel)]
    written = [folder.record, folder.curves, folder.table]
    write_curves(panels, folder.curves)
    over = over_panels(panels) if planned.experiment.table == "iterations" else {}
    write_text(folder.table, _page(planned, rows, over))
    written += draw(planned, panels, folder)
    if not ExperimentRecord.read(folder.record).finished:
        record_of(planned, finished=True).write(folder.record)
    reproduced = Reproduced(planned, rows, over, nobody_reached(rows), written)
    watcher.finish(reproduced)
    return reproduced


def _page(
    planned: PlannedExperiment, rows: Sequence[MeasuredRow], over: Mapping[str, Aggregated]
) -> str:
    experiment = planned.experiment
    lines = [f"# {experiment.name}: {experiment.item}, scale {planned.scale}", ""]
    if planned.scale == "smoke":
        lines += ["A trial of two iterations: no number here is a result.", ""]
    lines += [
        experiment.summary,
        *([f"The paper: {experiment.claim}"] * bool(experiment.claim)),
        "",
    ]
    lines += [*markdown(rows, experiment.table), "", f"{MEANING}; {MORE}.", *nobody_reached(rows)]
    lines += ["", *over_markdown(over)]
    return "\n".join(lines) + "\n"
