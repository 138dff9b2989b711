"""What training commands share: check names, train under a screen, draw, say what was written."""

import dataclasses
import shlex
from collections.abc import Sequence
from contextlib import nullcontext
from itertools import chain, count
from pathlib import Path

from repaint_cli.cli.console import literal
from repaint_cli.cli.screen import Screen, out
from repaint_cli.errors import NotFound, StoreError, Terminated, UsageError
from repaint_cli.files.atomic import check_writable
from repaint_cli.paths import user_zoo
from repaint_cli.provenance import stamp
from repaint_cli.runs.experiment import Experiment
from repaint_cli.runs.figures import draw_run
from repaint_cli.runs.plan import Plan, plan_of
from repaint_cli.runs.reader import read_run
from repaint_cli.runs.tensorboard import Events, require_tensorboard
from repaint_cli.tasks.methods import METHODS
from repaint_cli.zoo import store
from repaint_cli.zoo.teacher_card import check_name


def new_folder(run: Path | None, task: str, what: str) -> Path:
    """Return the folder of a new run: the one asked for, or runs/<task>/<what>-<stamp>.

    Two of a second, or of an hour that the clock was put back, are told apart by a number.
    """
    if run:
        return run
    first = Path("runs") / task / f"{what}-{stamp()}"
    others = (first.with_name(f"{first.name}-{n}") for n in count(2))
    return next(folder for folder in chain([first], others) if not folder.exists())


def new_teacher_name(name: str, replace: bool) -> str:
    """Check that a teacher may be added to the user's zoo under a name.

    Raises:
        StoreError: it may not, or one is there already.
    """
    check_name(name)
    path = user_zoo() / f"{name}.safetensors"
    if path.exists() and not replace:
        raise StoreError(
            f"your zoo has a teacher '{name}' already; give another name, or --replace it"
        )
    check_writable(path.parent)  # better now than after an hour of training
    return name


def find_teachers(names: Sequence[str] | None, method: str) -> tuple[Path, ...]:
    """Return the teachers' files; none for a method without them.

    Raises:
        NotFound: there is no such teacher, or none was named for a method that needs one.
        UsageError: there are several, and the method starts from one.
    """
    if not METHODS[method].needs_teacher:
        return ()
    if not names:
        raise NotFound(f"method '{method}' needs a teacher: --teacher NAME (repaint zoo list)")
    if METHODS[method].warm_start and len(names) > 1:
        raise UsageError(f"expected one --teacher to warm-start from, found {len(names)}")
    return tuple(store.find(name) for name in names)


def find_acting(names: Sequence[str] | None, teachers: Sequence[Path]) -> tuple[Path, ...] | None:
    """Return the files of those teachers whose own samples are used, or None for all of them.

    Raises:
        UsageError: one of them is none of the run's teachers.
    """
    if not names:
        return None
    acting = tuple(store.find(name) for name in names)
    for name, path in zip(names, acting, strict=True):
        if path not in teachers:
            known = ", ".join(teacher.stem for teacher in teachers)
            raise UsageError(f"expected --instances-from one of {known}, found '{name}'")
    return acting


def plan_again(
    folder: Path,
    iterations: int | None,
    teacher_name: str | None = None,
    replace: bool = False,
    *,
    for_teacher: bool = False,
) -> Plan:
    """Return the plan of a run that is to go on, perhaps for more iterations.

    Args:
        folder: of the run.
        iterations: how many in all; as planned where absent.
        teacher_name: another name for the teacher that it trains.
        replace: whether that may replace one in the zoo.
        for_teacher: whether it is to be a run of train-teacher, or else one of transfer.

    Raises:
        NotFound: there is no such run, or its teacher is gone.
        CheckpointError: its files are damaged or of another version.
        TeacherMismatch: its teacher is another one now.
        UsageError: it is a run of the other command, or has more iterations already.
        StoreError: the teacher's name is taken.
    """
    run = read_run(folder)
    plan = plan_of(run.record, run.task, folder)
    if (plan.teacher_name is not None) != for_teacher:
        raise UsageError(f"{folder} was begun otherwise; go on with: {resuming(plan)}")
    done = run.returns.shape[1]
    if iterations is not None:
        if iterations < done:
            raise UsageError(
                f"expected --iterations of at least {done}, which {folder} has, found {iterations}"
            )
        plan = plan.for_iterations(iterations)
    if not for_teacher:
        return plan
    name, may = teacher_name or plan.teacher_name or "", replace or plan.replace
    if done < plan.task.ppo.n_iterations:
        new_teacher_name(name, may)
    return dataclasses.replace(plan, teacher_name=name, replace=may)


def resuming(plan: Plan) -> str:
    """Return the command that goes on with a run."""
    command = "transfer" if plan.teacher_name is None else "train-teacher"
    return f"repaint {command} --resume {shlex.quote(str(plan.folder))}"


def carry_out(plan: Plan, tensorboard: bool, *, resume: bool = False) -> None:
    """Train as planned, then draw, write teachers and say what was written.

    Ctrl-C ends the training early; what was finished is drawn and named all the same, and the exit
    code is 130. SIGTERM draws nothing; the exit code is 143.

    Args:
        plan: what to do.
        tensorboard: whether to write events too.
        resume: whether the plan's folder holds the beginning of it.
    """
    if tensorboard:
        require_tensorboard()
    experiment = Experiment.resume(plan) if resume else Experiment.begin(plan)
    for notice in experiment.notices:
        out.print(f"[yellow]warning:[/yellow] {literal(notice)}")
    interruption = _train(experiment, tensorboard)
    try:
        written, following = _finish(experiment, early=interruption is not None)
    except (KeyboardInterrupt, Terminated, StoreError):
        out.print(f"not all is drawn and kept; next: [bold]{literal(resuming(plan))}[/bold]")
        raise
    written += [plan.files.tensorboard] if tensorboard else []
    say_written(written, following)
    if interruption:
        raise interruption


def _finish(experiment: Experiment, early: bool) -> tuple[list[Path], str]:
    """Write teachers and draw; return all that is in the folder, and the next command to type."""
    plan, files = experiment.plan, experiment.plan.files
    written = [files.record, files.metrics, files.checkpoint, files.best, *experiment.policies()]
    following = f"repaint eval {shlex.quote(str(plan.folder))} --render-offscreen"
    if plan.teacher_name and not early:  # before anything that might fail
        written.append(experiment.best_teacher(plan.teacher_name, user_zoo(), plan.replace))
        if not plan.task.reward_code:  # which is never run from a teacher's file
            following = f"repaint eval {plan.teacher_name} --render-offscreen"
    written += draw_run(read_run(plan.folder))
    if plan.task.env.has_paths:
        written.append(files.evaluations)
    if logs := plan.task.env.logs:
        written += logs.folders(plan.folder, plan.seeds)
    return written, resuming(plan) if early else following


def _train(experiment: Experiment, tensorboard: bool) -> KeyboardInterrupt | None:
    """Train under a screen; return what ended it early, if that left something to draw."""
    plan = experiment.plan
    events = Events(plan.files.tensorboard, plan.seeds) if tensorboard else nullcontext()
    try:
        with Screen(experiment) as screen, events as watcher:
            for report in experiment.run():
                screen.show(report, experiment.newest_alarms)
                if watcher:
                    watcher.add(report)
    except (KeyboardInterrupt, Terminated) as interruption:
        out.print(f"interrupted after iteration {experiment.learner.iteration}")
        if isinstance(interruption, Terminated) or not experiment.learner.iteration:
            out.print(f"next: [bold]{literal(resuming(plan))}[/bold]")
            raise
        return interruption
    except StoreError:
        out.print(f"next: [bold]{literal(resuming(plan))}[/bold]")
        raise
    return None


def say_written(files: list[Path], following: str) -> None:
    """Print every file written, folder by folder, and the next command worth typing."""
    folders: dict[Path, list[str]] = {}
    for path in files:
        folders.setdefault(path.parent, []).append(path.name)
    for folder, names in folders.items():
        out.print(f"wrote [bold]{literal(folder)}/[/bold]: {literal(', '.join(names))}")
    out.print(f"next: [bold]{literal(following)}[/bold]")
