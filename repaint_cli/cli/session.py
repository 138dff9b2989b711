"""What training commands share: check names, train under a screen, draw, say what was written."""

from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path

from repaint_cli import zoo
from repaint_cli.cli.screen import Screen, out
from repaint_cli.errors import CardError, NotFound, StoreError
from repaint_cli.files import check_writable
from repaint_cli.history import read_run
from repaint_cli.methods import METHODS
from repaint_cli.paths import user_zoo
from repaint_cli.report.events import Events, require_tensorboard
from repaint_cli.report.pictures import draw_run
from repaint_cli.runs import BEST, CHECKPOINT, Experiment, Plan, stamp
from repaint_cli.simtrace import log_folders
from repaint_cli.simulators import RacerEnv


def new_folder(run: Path | None, task: str, what: str) -> Path:
    """Return the folder of a new run: the one asked for, or runs/<task>/<what>-<stamp>."""
    return run or Path("runs") / task / f"{what}-{stamp()}"


def new_teacher_name(name: str, replace: bool) -> str:
    """Check that a teacher may be added to the user's zoo under a name.

    Raises:
        StoreError: it may not, or one is there already.
    """
    zoo.check_name(name)
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
        CardError: there are several, and the method starts from one.
    """
    if not METHODS[method].needs_teacher:
        return ()
    if not names:
        raise NotFound(f"method '{method}' needs a teacher: --teacher NAME (repaint zoo list)")
    if METHODS[method].warm_start and len(names) > 1:
        raise CardError(f"expected one --teacher to warm-start from, found {len(names)}")
    return tuple(zoo.find(name) for name in names)


def find_acting(names: Sequence[str] | None, teachers: Sequence[Path]) -> tuple[Path, ...] | None:
    """Return the files of those teachers whose own samples are used, or None for all of them.

    Raises:
        CardError: one of them is none of the run's teachers.
    """
    if not names:
        return None
    acting = tuple(zoo.find(name) for name in names)
    for name, path in zip(names, acting, strict=True):
        if path not in teachers:
            known = ", ".join(teacher.stem for teacher in teachers)
            raise CardError(f"expected --instances-from one of {known}, found '{name}'")
    return acting


def carry_out(plan: Plan, tensorboard: bool, teacher: tuple[str, Path] | None = None) -> None:
    """Train as planned, then draw, write teachers and say what was written.

    Ctrl-C ends the training early; what was finished is drawn and named all the same, and the exit
    code is 130.

    Args:
        plan: what to do.
        tensorboard: whether to write events too.
        teacher: the name and the zoo under which to keep the best evaluated policy.
    """
    if tensorboard:
        require_tensorboard()
    experiment = Experiment(plan)
    events = Events(plan.folder / "tensorboard", plan.seeds) if tensorboard else nullcontext()
    interrupted = False
    try:
        with Screen(experiment) as screen, events as watcher:
            for report in experiment.run():
                screen.show(report, experiment.newest_alarms)
                if watcher:
                    watcher.add(report)
    except KeyboardInterrupt:
        interrupted = True
        out.print(f"interrupted after iteration {len(experiment.reports)}")
        if not experiment.reports:
            raise
    names = ("run.json", "metrics.csv", CHECKPOINT, f"{BEST}.safetensors")
    written = [plan.folder / name for name in names]
    written += experiment.policies()
    following = f"repaint eval {plan.folder} --render-offscreen"
    if teacher and not interrupted:  # before anything that might fail
        written.append(experiment.best_teacher(*teacher))
        if not plan.task.reward_code:  # which is never run from a teacher's file
            following = f"repaint eval {teacher[0]} --render-offscreen"
    written += draw_run(read_run(plan.folder), experiment.reports)
    if isinstance(plan.task.env, RacerEnv):
        written += log_folders(plan.folder, plan.seeds)
    written += [plan.folder / "tensorboard"] if tensorboard else []
    say_written(written, following)
    if interrupted:
        raise KeyboardInterrupt


def say_written(files: list[Path], following: str) -> None:
    """Print every file written, folder by folder, and the next command worth typing."""
    folders: dict[Path, list[str]] = {}
    for path in files:
        folders.setdefault(path.parent, []).append(path.name)
    for folder, names in folders.items():
        out.print(f"wrote [bold]{folder}/[/bold]: {', '.join(names)}")
    out.print(f"next: [bold]{following}[/bold]")
