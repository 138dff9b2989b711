"""Train what of an experiment is not trained yet: teachers first, then the runs that need them."""

from collections.abc import Sequence
from dataclasses import dataclass

from repaint_cli.activity import doing
from repaint_cli.engines.engine import Engine, Outcome, RunsFailed
from repaint_cli.engines.options import EngineOptions, RunsWatcher
from repaint_cli.experiments.planned import PlannedExperiment, PlannedRun, PlannedTeacher
from repaint_cli.runs.folder import RunFolder
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.with_teachers import check_before_playing, with_measured
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


class TrainingWatcher(RunsWatcher):
    """Follows the training of an experiment; this base class does nothing."""

    def trained(self, trained: Trained) -> None:
        """A run is finished."""


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


def train(
    planned: PlannedExperiment, engine: Engine, options: EngineOptions, watcher: TrainingWatcher
) -> None:
    """Train what is left of an experiment.

    A run whose teacher could not be made is left for another time.

    Args:
        planned: the experiment.
        engine: that carries out the runs.
        options: of the engine, for the command that goes on.
        watcher: follows the training.

    Raises:
        RunsFailed: some runs failed; those that were finished are kept.
    """
    waiting = unfinished(planned)
    check(waiting)
    makers = {teacher.run.key for teacher in planned.teachers() if teacher.run}
    failed, done = list[Outcome](), 0
    for stage in (
        [r for r in waiting if r.key in makers],
        [r for r in waiting if r.key not in makers],
    ):
        able = [run for run in stage if all(teacher.file.exists() for teacher in run.teachers)]
        by_folder = {run.folder: run for run in able}
        plans = [_begun(run) for run in able]
        watcher.training(plans)
        for outcome in engine.run(plans):
            if outcome.error:
                failed.append(outcome)
                watcher.failed(outcome)
                continue
            done += 1
            watcher.trained(Trained(by_folder[outcome.folder], done, len(waiting)))
        for teacher in planned.teachers():
            make_teacher(teacher, scored=planned.scale != "smoke")
    if failed:
        error = RunsFailed.of(failed, len(waiting), planned.command(options=options))
        raise error from failed[0].error


def _begun(run: PlannedRun) -> Plan:
    """Return a run's plan; a new one whose transfer is automatic has its teachers play."""
    return run.plan if run.read() else with_measured(run.plan)


def make_teacher(teacher: PlannedTeacher, scored: bool) -> None:
    """Write the best policy of a run as a teacher once that is finished, perhaps with a score.

    Raises:
        CheckpointError: the policy's file is damaged.
        StoreError: the file cannot be written.
    """
    if teacher.run is None or teacher.file.exists() or teacher.run.left() is not None:
        return
    network, card = store.read_teacher(RunFolder(teacher.run.folder).best)
    known: dict[str, object] = {"name": teacher.file.stem}
    if scored:
        with doing(f"scoring {teacher.name}"):
            known["score"] = score(network, card.task, card.seed)
    store.add(network, 0, card.model_copy(update=known), teacher.file.parent)
