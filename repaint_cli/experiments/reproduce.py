"""Reproduce an experiment: plan, train what is left, draw, table, record."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from repaint_cli.experiments.estimates import seconds_left
from repaint_cli.experiments.figures import draw
from repaint_cli.experiments.folder import ExperimentFolder, ExperimentRecord, claim, record_of
from repaint_cli.experiments.measures import MeasuredRow, rows_of
from repaint_cli.experiments.planning import PlannedExperiment, plan_experiment
from repaint_cli.experiments.results import measured, write_curves
from repaint_cli.experiments.schema import Experiment
from repaint_cli.experiments.tables import MEANING, MORE, markdown, nobody_reached
from repaint_cli.experiments.training import Trained, train, unfinished
from repaint_cli.files.atomic import write_text

INTO = Path("reproduce")
"""Where experiments lie, unless they are put elsewhere."""


@dataclass(frozen=True)
class Outlook:
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
    warnings: list[str]
    """What its numbers cannot say."""
    written: list[Path]
    """Its files, without those of its runs."""


class Follower:
    """Follows experiments; this base class does nothing."""

    def begin(self, outlooks: Sequence[Outlook]) -> None:
        """All is checked; this is what will be trained."""

    def trained(self, trained: Trained) -> None:
        """A run is finished."""

    def finish(self, reproduced: Reproduced) -> None:
        """An experiment is done."""


def reproduce(
    experiments: Sequence[Experiment],
    scale: str,
    into: Path = INTO,
    jobs: int = 1,
    follower: Follower | None = None,
    replace: bool = False,
) -> list[Reproduced]:
    """Carry out experiments at a scale; what has been trained is not trained again.

    Args:
        experiments: in the order in which they are carried out.
        scale: "smoke", "night" or "paper".
        into: the folder of all experiments and of the runs that they share.
        jobs: how many runs train at a time.
        follower: follows them.
        replace: whether folders of other experiments of the same names may be written.

    Raises:
        RepaintError: an experiment cannot be planned, or what stopped a run; finished runs stay.
    """
    follower = follower or Follower()
    planned = [plan_experiment(one, scale, into) for one in experiments]
    folders = [claim(one, replace) for one in planned]
    follower.begin(outlooks(planned))
    return [
        _carried_out(one, folder, jobs, follower)
        for one, folder in zip(planned, folders, strict=True)
    ]


def outlooks(planned: Sequence[PlannedExperiment]) -> list[Outlook]:
    """Return what experiments would train one after the other; shared runs count for the first.

    Raises:
        RepaintError: see `seconds_left`.
    """
    seen, found = set[str](), []
    for one in planned:
        new = [run for run in unfinished(one) if run.key not in seen]
        seen |= {run.key for run in new}
        found.append(Outlook(one, len(new), seconds_left(new)))
    return found


def _carried_out(
    planned: PlannedExperiment, folder: ExperimentFolder, jobs: int, follower: Follower
) -> Reproduced:
    train(planned, jobs, follower.trained)
    panels = measured(planned)
    rows = [row for panel in panels for row in rows_of(panel)]
    written = [folder.record, folder.curves, folder.table]
    write_curves(panels, folder.curves)
    write_text(folder.table, _page(planned, rows))
    written += draw(planned, panels, folder)
    if not ExperimentRecord.read(folder.record).finished:
        record_of(planned, finished=True).write(folder.record)
    reproduced = Reproduced(planned, rows, nobody_reached(rows), written)
    follower.finish(reproduced)
    return reproduced


def _page(planned: PlannedExperiment, rows: Sequence[MeasuredRow]) -> str:
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
    return "\n".join(lines) + "\n"
