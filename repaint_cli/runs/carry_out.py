"""Carry out a plan: train, draw what came of it, and add the teacher to the zoo."""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from repaint_cli import interruption
from repaint_cli.activity import doing, progress
from repaint_cli.envs.output import PrintsInFile, prints_in_file
from repaint_cli.errors import RewardFailed, StoreError
from repaint_cli.files.paths import user_zoo
from repaint_cli.learn.side_by_side import one_thread
from repaint_cli.runs.elsewhere import remember
from repaint_cli.runs.experiment import Experiment
from repaint_cli.runs.figures import draw_run
from repaint_cli.runs.metrics import Report
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.reader import RecordedRun, read_run
from repaint_cli.runs.record_parts import Alarm
from repaint_cli.runs.run_page import run_page_if_possible
from repaint_cli.runs.trackers.tracker import TrackedRun, require, tracker_class
from repaint_cli.runs.trackers.tracking import Tracking, trackers_of
from repaint_cli.zoo import store
from repaint_cli.zoo.scoring import score


@dataclass(frozen=True)
class TrainedRun:
    """A run that was trained, to its end or until it was interrupted."""

    run: RecordedRun
    """Its folder, read: `run.returns` are evaluated mean returns, (S, K)."""
    plan: Plan
    """What was to be done."""
    written: list[Path]
    """Files and folders that it wrote."""
    teacher: Path | None
    """The teacher's file in the user's zoo, if it trained one to the end."""
    notices: tuple[str, ...] = ()
    """Warnings of what could not be written, and is no part of the run."""


class Watcher:
    """Follows a training; this base class does nothing."""

    def begin(self, experiment: Experiment) -> None:
        """A run is about to train."""

    def show(self, report: Report, alarms: Sequence[Alarm]) -> None:
        """An iteration is on disk; the alarms are what looked wrong in it."""

    def end(self, experiment: Experiment, cause: BaseException | None) -> None:
        """The run trains no longer, because of an exception or as it is done.

        Figures and teachers are still to be written.
        """

    def finish(self, trained: TrainedRun, interrupted: bool) -> None:
        """All is written; the run may have been interrupted before its last iteration."""


def carry_out(
    owned: AbstractContextManager[Experiment],
    watcher: Watcher | None = None,
    *,
    track: Sequence[str] = (),
    finish_interrupted: bool = True,
) -> TrainedRun:
    """Train, draw, and write policies and the teacher, while the run's folder is held.

    Ctrl-C, or a reward function that fails, ends the training early: what was finished is drawn and
    written all the same before it is raised again. SIGTERM draws nothing.

    Args:
        owned: a run of `owner`, which holds its folder.
        watcher: who follows it.
        track: names of trackers.
        finish_interrupted: whether to draw and write what was finished before Ctrl-C.

    Raises:
        RepaintError: see `Experiment`.
        KeyboardInterrupt: the training was interrupted.
        Terminated: the process was asked to end.
    """
    for name in track:
        require(name)
    watcher = watcher or Watcher()
    with (
        one_thread(),
        prints_in_file() as prints,
        owned as experiment,
        prints.kept_in(experiment.plan.files.environment_log),  # while the folder is held
    ):
        track = _begin(experiment, watcher, prints, track)
        ended_by = _train(experiment, watcher, prints, track)
        if ended_by and not finish_interrupted:
            raise ended_by
        trained = _finish(experiment, ended_by is not None, track)
        prints.flush()
        watcher.finish(trained, ended_by is not None)
    if ended_by:
        raise ended_by
    return trained


def _begin(
    experiment: Experiment, watcher: Watcher, prints: PrintsInFile, track: Sequence[str]
) -> Sequence[str]:
    """Make a run ready, and tell who follows it; return the trackers, also earlier ones of it."""
    track, notices = trackers_of(experiment.plan.files, track)
    experiment.notices += notices
    experiment.prints = prints
    remember(experiment.plan.folder)
    watcher.begin(experiment)
    return track


def _train(
    experiment: Experiment, watcher: Watcher, prints: PrintsInFile, track: Sequence[str]
) -> KeyboardInterrupt | RewardFailed | None:
    """Train; return what ended it early, if that left something to draw."""
    plan = experiment.plan
    cause: BaseException | None = None
    k = experiment.learner.iteration
    try:
        with (
            Tracking(track, _tracked(plan), k) as trackers,
            doing(f"{plan.method} · {plan.task.name}"),
        ):
            progress(k, plan.task.ppo.n_iterations, "iterations")
            for report in experiment.run():
                progress(report.stats.iteration, plan.task.ppo.n_iterations, "iterations")
                prints.flush()
                watcher.show(report, experiment.newest_alarms)
                trackers.add(report)
    except BaseException as error:
        cause = error
        if isinstance(error, KeyboardInterrupt) and experiment.learner.iteration:
            interruption.arrived()
            return error
        if isinstance(error, RewardFailed) and experiment.learner.iteration:
            return error
        raise
    finally:
        watcher.end(experiment, cause)
    return None


def _tracked(plan: Plan) -> TrackedRun:
    """Return what trackers are told of a run."""
    settings = {"task": plan.task.model_dump(mode="json"), "method": plan.method}
    settings |= {"algorithm": plan.algorithm, "teachers": [file.name for file in plan.teachers]}
    return TrackedRun(plan.files, plan.seeds, settings)


def _finish(experiment: Experiment, interrupted: bool, track: Sequence[str]) -> TrainedRun:
    """Write policies and the teacher, and draw."""
    plan, files, teacher = experiment.plan, experiment.plan.files, None
    written = [files.record, files.metrics, files.checkpoint, files.best, *experiment.policies()]
    if plan.teacher_name and not interrupted:  # before anything that might fail
        teacher = _best_teacher(experiment, plan.teacher_name, user_zoo())
        written.append(teacher)
    run = read_run(plan.folder)
    written += draw_run(run)
    page, notices = run_page_if_possible(run)
    written += page
    if plan.task.env.paths:
        written.append(files.evaluations)
    if logs := plan.task.env.logs:
        written += logs.folders(plan.folder, plan.seeds)
    places = [tracker_class(name).place(files) for name in track]
    written += [place for place in places if place.exists()]
    written += [files.environment_log] if files.environment_log.exists() else []
    return TrainedRun(run, plan, written, teacher, tuple(notices))


def _best_teacher(experiment: Experiment, name: str, folder: Path) -> Path:
    """Score the best evaluated policy on fresh seeds and write it as a teacher.

    Raises:
        StoreError: another teacher has that name by now, or the folder cannot be written.
    """
    best, replace = experiment.plan.files.best, experiment.plan.replace
    network, card = store.read_teacher(best)
    with doing("scoring"):
        scored = {"name": name, "score": score(network, experiment.card, card.seed)}
    try:
        return store.add(network, 0, card.model_copy(update=scored), folder, replace=replace)
    except StoreError as error:
        raise StoreError(f"{error}; the policy is kept in {best}") from error
