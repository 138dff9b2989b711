"""Train what of an experiment is not trained yet: teachers first, then the runs that need them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from repaint_cli.activity import doing
from repaint_cli.errors import RepaintError
from repaint_cli.experiments.planned import PlannedExperiment, PlannedRun, PlannedTeacher
from repaint_cli.runs.folder import RunFolder
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.with_teachers import check_before_playing, with_measured
from repaint_cli.runs.workers import train_all
from repaint_cli.zoo import store
from repaint_cli.zoo.scoring import score


@dataclass(frozen=True)
class Trained:
    """A run of an experiment that has been trained now."""

    run: PlannedRun
    done: int
    """How many were trained, this one counted."""
    total: int
    """How many were to be trained."""


OnTrained = Callable[[Trained], object]
"""Is called with each run as it is finished."""


def unfinished(planned: PlannedExperiment) -> list[PlannedRun]:
    """Return the runs that are to be trained, or trained further.

    Raises:
        CheckpointError: a run's files are damaged.
        StoreError: a folder holds another run.
    """
    return [run for run in planned.all_runs() if run.left() is not None]


def check(runs: Sequence[PlannedRun]) -> None:
    """Check what can be before anything is trained: the cards, and teachers that are there.

    Raises:
        RepaintError: a run could not begin.
    """
    for run in runs:
        if all(teacher.file.exists() for teacher in run.teachers):
            check_before_playing(run.plan)


def train(planned: PlannedExperiment, jobs: int, on_trained: OnTrained) -> None:
    """Train what is left of an experiment, as many runs at a time as there are jobs.

    Raises:
        RepaintError: what stopped a run; those that were finished are kept.
    """
    waiting = unfinished(planned)
    check(waiting)
    makers = {teacher.run.key for teacher in planned.teachers() if teacher.run}
    stages = ([r for r in waiting if r.key in makers], [r for r in waiting if r.key not in makers])
    done, total = 0, len(waiting)
    try:
        for stage in stages:
            for run in _trained(stage, jobs):
                done += 1
                on_trained(Trained(run, done, total))
            for teacher in planned.teachers():
                make_teacher(teacher, scored=planned.scale != "smoke")
    except RepaintError as error:
        again = planned.command(jobs=jobs)
        raise type(error)(f"{error}; finished runs are kept, go on with: {again}") from error


def _trained(runs: Sequence[PlannedRun], jobs: int) -> Iterator[PlannedRun]:
    by_folder = {run.folder: run for run in runs}
    for folder in train_all([_begun(run) for run in runs], jobs):
        yield by_folder[folder]


def _begun(run: PlannedRun) -> Plan:
    """Return a run's plan; a new one whose transfer is automatic has its teachers play."""
    return run.plan if run.read() else with_measured(run.plan)


def make_teacher(teacher: PlannedTeacher, scored: bool) -> None:
    """Write the best policy of a finished run as a teacher, perhaps with a score; once.

    Raises:
        CheckpointError: the policy's file is damaged.
        StoreError: the file cannot be written.
    """
    if teacher.run is None or teacher.file.exists():
        return
    network, card = store.read_teacher(RunFolder(teacher.run.folder).best)
    known: dict[str, object] = {"name": teacher.file.stem}
    if scored:
        with doing(f"scoring {teacher.name}"):
            known["score"] = score(network, card.task, card.seed)
    store.add(network, 0, card.model_copy(update=known), teacher.file.parent)
