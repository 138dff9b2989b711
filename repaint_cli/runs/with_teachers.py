"""A plan's teachers: found by what was typed, and measured where something is open."""

from collections.abc import Sequence
from dataclasses import replace

from repaint_cli.errors import NotFound, UsageError, some
from repaint_cli.runs.measured_teachers import Choice, best_of_zoo, chosen
from repaint_cli.runs.plan import Plan
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.methods import METHODS
from repaint_cli.zoo import store, view_names
from repaint_cli.zoo.teacher_card import read_card
from repaint_cli.zoo.view_names import AUTO, TeacherFile
from repaint_cli.zoo.views import as_warm_started


def with_teachers(plan: Plan, names: Sequence[str], acting: Sequence[str] = ()) -> Plan:
    """Return a plan with teachers, which play the task where something of them is open.

    Args:
        plan: without teachers.
        names: as they are typed.
        acting: those whose own samples are learned from; all where empty.

    Raises:
        As `choose`, `find_acting` and `settled`.
    """
    if acting and list(names) == [AUTO]:
        raise UsageError("--instances-from needs teachers by name, found --teacher auto")
    if acting:
        files = find_teachers(names, plan.method)
        plan = replace(plan, teachers=files, acting=find_acting(acting, files))
    return settled(plan, choose(plan, names))


def choose(plan: Plan, names: Sequence[str]) -> Choice:
    """Return the teachers that were typed, or the best of the zoo for `auto`.

    Raises:
        As `find_teachers`, `best_of_zoo` and `chosen`.
    """
    if list(names) == [AUTO] and METHODS[plan.method].needs_teacher:
        return best_of_zoo(plan.target, plan.seeds[0])
    files = find_teachers(names, plan.method)
    if plan.target.automatic or any(file.view == AUTO for file in files):
        check_before_playing(replace(plan, teachers=files, acting=None))
    return chosen(plan.target, files, plan.seeds[0])


def check_before_playing(plan: Plan) -> None:
    """Check a plan whose teachers' views may be open.

    Raises:
        As `Plan.check`.
    """
    files = (TeacherFile(file, "" if view == AUTO else view) for file, view in plan.teachers)
    replace(plan, teachers=tuple(files)).check()


def with_measured(plan: Plan) -> Plan:
    """Return a plan whose teachers have played where something of them is open.

    Raises:
        As `chosen` and `as_warm_started`.
    """
    return settled(plan, chosen(plan.target, plan.teachers, plan.seeds[0]))


def settled(plan: Plan, choice: Choice) -> Plan:
    """Return a plan with what was chosen: views of teachers, and what students start from.

    Raises:
        UsageError: several teachers are named for a method that starts from one.
        As `as_warm_started`.
    """
    if METHODS[plan.method].warm_start and len(choice.files) > 1:
        raise UsageError(f"expected one --teacher to warm-start from, found {len(choice.files)}")
    acting = plan.acting
    if acting is not None:
        acting = tuple(choice.files[plan.teachers.index(file)] for file in acting)
    plan = replace(
        plan, task=choice.settled(plan.task), teachers=choice.files, acting=acting,
        ranked=choice.ranked,
    )  # fmt: skip
    return replace(plan, task=_as_begun(plan))


def _as_begun(plan: Plan) -> TaskCard:
    """Return a plan's card with what the teacher decides that a student starts from."""
    if plan.target.transfer.start != "teacher":
        return plan.task
    path, view = plan.teachers[0]
    own = read_card(path)
    return as_warm_started(plan.task, store.to_type(path, own), own.task, view)


def find_teachers(names: Sequence[str], method: str) -> tuple[TeacherFile, ...]:
    """Return the teachers' files and views; none for a method without them.

    Raises:
        NotFound: there is no such teacher, or no teacher is named for a method that needs one.
        UsageError: one is named for a method without, or `auto` beside others.
    """
    if not METHODS[method].needs_teacher:
        if names:
            raise UsageError(f"method '{method}' learns without a teacher: leave out {names[0]}")
        return ()
    if not names:
        raise NotFound(f"method '{method}' needs a teacher: --teacher NAME (repaint zoo list)")
    if AUTO in names:
        others = ", ".join(view_names.split(n)[0] for n in names if n != AUTO) or AUTO
        raise UsageError(f"--teacher auto stands alone, found {others} beside it")
    return tuple(view_names.find(name) for name in names)


def find_acting(names: Sequence[str], teachers: Sequence[TeacherFile]) -> tuple[TeacherFile, ...]:
    """Return the files of those teachers whose own samples are used.

    Raises:
        UsageError: a named teacher is not among the run's teachers.
    """
    acting = tuple(view_names.find(name) for name in names)
    for name, file in zip(names, acting, strict=True):
        if file not in teachers:
            known = some([teacher.name for teacher in teachers])
            raise UsageError(f"expected --instances-from one of {known}, found '{name}'")
    return acting
