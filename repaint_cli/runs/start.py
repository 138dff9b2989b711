"""From names to a plan: what the user asks for, checked before anything is trained."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from repaint_cli.errors import DeviceError, StoreError, UsageError, some
from repaint_cli.files.provenance import stamp
from repaint_cli.policies.devices import device_named
from repaint_cli.policies.precision import resolved
from repaint_cli.runs.folder import RUNS
from repaint_cli.runs.mended import check_mended, mended_task, notices_of_text
from repaint_cli.runs.new_folder import check_absent
from repaint_cli.runs.plan import Plan, plan_of
from repaint_cli.runs.reader import read_run
from repaint_cli.runs.with_teachers import with_teachers
from repaint_cli.settings import MOST_SEEDS
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.methods import method_for
from repaint_cli.zoo import store, view_names
from repaint_cli.zoo.teacher_card import check_name


def plan_teacher(
    card: TaskCard,
    seeds: Sequence[int],
    name: str | None,
    replace: bool,
    folder: str | Path | None,
    keep: int,
    device: str = "cpu",
) -> Plan:
    """Return the plan of a run that trains a teacher; see `repaint_cli.train`."""
    numbers, device = checked_seeds(seeds), device_named(device)
    replace = replace or name is None  # only a name that was asked for is refused where it is taken
    name = new_teacher_name(name or card.name, replace)
    place = new_folder(folder, card.name, "scratch")
    return Plan(
        on_this_machine(card), "scratch", numbers, place, teacher_name=name, replace=replace,
        keep=keep, device=device, numbered=not folder,
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
    view: str | None = None,
    device: str = "cpu",
) -> Plan:
    """Return the plan of a transfer; see `repaint_cli.transfer`."""
    device = device_named(device)
    method, numbers = method_for(algorithm, method), checked_seeds(seeds)
    if folder:
        check_absent(Path(folder))  # better now than after teachers have played
    names, acting = (view_names.in_view(n, view or "none") for n in (teachers, instances_from))
    plan = Plan(card, method, numbers, Path(), algorithm=algorithm, keep=keep, numbered=not folder)
    plan = with_teachers(plan, names, acting)
    parts = [algorithm] * (algorithm != "ppo") + [method, *(file.name for file in plan.teachers)]
    place = new_folder(folder, card.name, "-".join(parts))
    return replace(plan, task=on_this_machine(plan.task), folder=place, device=device)


def on_this_machine(card: TaskCard) -> TaskCard:
    """Return a card with what this machine decides; a run that is begun on it keeps that."""
    return card.model_copy(update={"net": resolved(card.net)})


def plan_resume(
    folder: Path,
    iterations: int | None = None,
    teacher_name: str | None = None,
    replace_teacher: bool = False,
    for_teacher: bool | None = None,
    device: str | None = None,
) -> Plan:
    """Return the plan of a run that goes on, perhaps for more iterations.

    Args:
        folder: of the run.
        iterations: how many in all; as planned where absent.
        teacher_name: another name for the teacher that it trains.
        replace_teacher: whether that may replace one in the zoo.
        for_teacher: whether it must train a teacher, or must not; no matter which where absent.
        device: where it goes on; where it was where absent.

    Raises:
        DeviceError: it is to go on on a GPU, and none works.
        NotFound: there is no such run, or its teacher is gone.
        CheckpointError: a file of the run is damaged or of another version.
        TeacherMismatch: the file of the run's teacher has changed.
        CardError: its reward function was mended, and its new text is not trusted.
        UsageError: the run is one of the other command, or has more iterations already.
        StoreError: the teacher's name is taken.
    """
    run = read_run(folder, to_resume=True)
    task, done = mended_task(run), run.returns.shape[1]
    check_mended(run, task)
    plan = plan_of(run.record, task, folder)
    now = _device_to_go_on(plan, device)
    moved = f"the run goes on on {now}, where {plan.device} learned before: not bit for bit"
    notices = [*notices_of_text(run, task), *[moved] * (now != plan.device)]
    plan = replace(plan, notices=tuple(notices), mended=task != run.task, device=now)
    if for_teacher is not None and (plan.teacher_name is not None) != for_teacher:
        raise UsageError(f"{folder} was begun otherwise; go on with: {plan.resume_command}")
    if iterations is not None:
        if iterations < done:
            raise UsageError(
                f"expected --iterations of at least {done}, which {folder} has, found {iterations}"
            )
        plan = plan.for_iterations(iterations)
    return _with_teacher_name(plan, done, teacher_name, replace_teacher)


def _with_teacher_name(plan: Plan, done: int, name: str | None, may_replace: bool) -> Plan:
    """Return the plan of a run that goes on with the name of the teacher that it trains.

    Args:
        plan: of the run.
        done: iterations that it has.
        name: another one; as planned where absent.
        may_replace: whether that may replace one in the zoo.

    Raises:
        StoreError: the name is taken, and there is something left to train.
    """
    if plan.teacher_name is None:
        return plan
    name = name or plan.teacher_name
    may_replace = may_replace or (plan.replace and name == plan.teacher_name)
    if done < plan.task.ppo.n_iterations:
        new_teacher_name(name, may_replace)
    return replace(plan, teacher_name=name, replace=may_replace)


def _device_to_go_on(plan: Plan, device: str | None) -> str:
    """Return where a run goes on: where it is told to, or where it was.

    Raises:
        DeviceError: that is a GPU, and none works.
    """
    if device is not None:
        return device_named(device)
    try:
        return device_named(plan.device)
    except DeviceError as error:
        raise DeviceError(
            f"the run learned on {plan.device} so far, which does not work here; --device cpu goes "
            f"on without it ({error})"
        ) from error


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
