"""From names to a plan: what the user asks for, checked before anything is trained."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from repaint_cli.errors import NotFound, StoreError, UsageError, some
from repaint_cli.files.provenance import stamp
from repaint_cli.policies.precision import resolved
from repaint_cli.runs.folder import RUNS
from repaint_cli.runs.measured_teachers import chosen
from repaint_cli.runs.new_folder import check_absent
from repaint_cli.runs.plan import Plan, plan_of
from repaint_cli.runs.reader import read_run
from repaint_cli.runs.record_parts import RankedRecord
from repaint_cli.settings import MOST_SEEDS
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.methods import METHODS, method_for
from repaint_cli.zoo import store, view_names
from repaint_cli.zoo.teacher_card import check_name, read_card
from repaint_cli.zoo.view_names import TeacherFile
from repaint_cli.zoo.views import as_warm_started


def plan_teacher(
    card: TaskCard,
    seeds: Sequence[int],
    name: str | None,
    replace: bool,
    folder: str | Path | None,
    keep: int,
) -> Plan:
    """Return the plan of a run that trains a teacher; see `repaint_cli.train`."""
    numbers = checked_seeds(seeds)
    replace = replace or name is None  # only a name that was asked for is refused where it is taken
    name = new_teacher_name(name or card.name, replace)
    place = new_folder(folder, card.name, "scratch")
    return Plan(
        on_this_machine(card), "scratch", numbers, place, teacher_name=name, replace=replace,
        keep=keep, numbered=not folder,
    )  # fmt: skip


def plan_transfer(
    card: TaskCard,
    teachers: Sequence[str],
    seeds: Sequence[int],
    method: str | None,
    algorithm: str,
    instances_from: Sequence[str],
    folder: str | Path | None,
    keep: int,
) -> Plan:
    """Return the plan of a transfer; see `repaint_cli.transfer`."""
    numbers = checked_seeds(seeds)
    method, ranked = method_for(algorithm, method), tuple[RankedRecord, ...]()
    if folder:
        check_absent(Path(folder))  # better now than after teachers have played
    if METHODS[method].needs_teacher:
        typed = teachers
        teachers, ranked = chosen(card, typed, numbers[0])
        taken = dict(zip(typed, teachers, strict=True))
        instances_from = [taken.get(name, name) for name in instances_from]
    files = find_teachers(teachers, method)
    names = [algorithm] * (algorithm != "ppo") + [method, *(file.name for file in files)]
    place = new_folder(folder, card.name, "-".join(names))
    acting = find_acting(instances_from, files)
    card = as_begun(card, method, files)
    return Plan(
        on_this_machine(card), method, numbers, place, files, acting, algorithm, keep=keep,
        numbered=not folder, ranked=ranked,
    )  # fmt: skip


def on_this_machine(card: TaskCard) -> TaskCard:
    """Return a card with what this machine decides; a run that is begun on it keeps that."""
    return card.model_copy(update={"net": resolved(card.net)})


def as_begun(card: TaskCard, method: str, teachers: Sequence[TeacherFile]) -> TaskCard:
    """Return a card with what the teacher decides that a student starts from.

    Raises:
        As `read_card` and `as_warm_started`.
    """
    if not METHODS[method].warm_start:
        return card
    path, view = teachers[0]
    own = read_card(path)
    return as_warm_started(card, store.to_type(path, own), own.task, view)


def plan_resume(
    folder: Path,
    iterations: int | None = None,
    teacher_name: str | None = None,
    replace_teacher: bool = False,
    *,
    for_teacher: bool | None = None,
) -> Plan:
    """Return the plan of a run that goes on, perhaps for more iterations.

    Args:
        folder: of the run.
        iterations: how many in all; as planned where absent.
        teacher_name: another name for the teacher that it trains.
        replace_teacher: whether that may replace one in the zoo.
        for_teacher: whether it must train a teacher, or must not; no matter which where absent.

    Raises:
        NotFound: there is no such run, or its teacher is gone.
        CheckpointError: a file of the run is damaged or of another version.
        TeacherMismatch: the file of the run's teacher has changed.
        UsageError: the run is one of the other command, or has more iterations already.
        StoreError: the teacher's name is taken.
    """
    run = read_run(folder, to_resume=True)
    plan, done = plan_of(run.record, run.task, folder), run.returns.shape[1]
    if for_teacher is not None and (plan.teacher_name is not None) != for_teacher:
        raise UsageError(f"{folder} was begun otherwise; go on with: {plan.resume_command}")
    if iterations is not None:
        if iterations < done:
            raise UsageError(
                f"expected --iterations of at least {done}, which {folder} has, found {iterations}"
            )
        plan = plan.for_iterations(iterations)
    if plan.teacher_name is None:
        return plan
    name = teacher_name or plan.teacher_name
    may_replace = replace_teacher or (plan.replace and name == plan.teacher_name)
    if done < plan.task.ppo.n_iterations:
        new_teacher_name(name, may_replace)
    return replace(plan, teacher_name=name, replace=may_replace)


def checked_seeds(seeds: Sequence[int]) -> list[int]:
    """Return the run seeds.

    Raises:
        UsageError: there is no seed, a negative one, one twice, or too many.
    """
    if isinstance(seeds, int):
        raise UsageError(f"expected a list of seeds, such as range({seeds}), found {seeds}")
    numbers = [int(seed) for seed in seeds]
    if not numbers or min(numbers) < 0 or len(set(numbers)) < len(numbers):
        found = some([str(seed) for seed in numbers]) or "none"
        raise UsageError(f"expected seeds of at least 0, each once, found {found}")
    if len(numbers) > MOST_SEEDS:
        raise UsageError(f"expected at most {MOST_SEEDS:,} seeds, found {len(numbers):,}")
    return numbers


def new_folder(folder: str | Path | None, task: str, what: str) -> Path:
    """Return the folder of a new run: the one asked for, or runs/<task>/<what>-<stamp>."""
    return Path(folder) if folder else RUNS / task / f"{what.replace(':', '-')}-{stamp()}"


def new_teacher_name(name: str, replace: bool) -> str:
    """Check that a teacher may be added to the user's zoo under a name.

    Raises:
        StoreError: the name is invalid or taken.
    """
    check_name(name)
    path = store.own_file(name)
    if path.exists() and not replace:
        raise StoreError(
            f"your zoo has a teacher '{name}' already; give another name, or --replace it"
        )
    return name


def find_teachers(names: Sequence[str], method: str) -> tuple[TeacherFile, ...]:
    """Return the teachers' files and views; none for a method without them.

    Raises:
        NotFound: there is no such teacher, or no teacher is named for a method that needs one.
        UsageError: several teachers are named for a method that starts from one, or one for a
            method without.
    """
    if not METHODS[method].needs_teacher:
        if names:
            raise UsageError(f"method '{method}' learns without a teacher: leave out {names[0]}")
        return ()
    if not names:
        raise NotFound(f"method '{method}' needs a teacher: --teacher NAME (repaint zoo list)")
    if METHODS[method].warm_start and len(names) > 1:
        raise UsageError(f"expected one --teacher to warm-start from, found {len(names)}")
    return tuple(view_names.find(name) for name in names)


def find_acting(
    names: Sequence[str], teachers: Sequence[TeacherFile]
) -> tuple[TeacherFile, ...] | None:
    """Return the files of those teachers whose own samples are used, or None for all of them.

    Raises:
        UsageError: a named teacher is not among the run's teachers.
    """
    if not names:
        return None
    acting = tuple(view_names.find(name) for name in names)
    for name, file in zip(names, acting, strict=True):
        if file not in teachers:
            known = some([teacher.name for teacher in teachers])
            raise UsageError(f"expected --instances-from one of {known}, found '{name}'")
    return acting
