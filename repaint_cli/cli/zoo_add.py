"""`repaint zoo add`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

from repaint_cli.cli.option_rules import parsed_into
from repaint_cli.cli.options import Replace, argument, option
from repaint_cli.errors import NotFound, UsageError
from repaint_cli.files.commands import command

if TYPE_CHECKING:
    from collections.abc import Callable

    from repaint_cli.policies.networks import ActorCritic
    from repaint_cli.policies.spaces import Spaces
    from repaint_cli.tasks.card import TaskCard
    from repaint_cli.zoo.importers.imported import Imported
    from repaint_cli.zoo.teacher_card import TeacherCard

IMPORT = "A policy of another library"


def _read_sb3(file: Path, *_: object) -> "tuple[Imported, bool | None]":
    from repaint_cli.zoo.importers import sb3

    return sb3.read(file)


def _read_cleanrl(file: Path, _: "TaskCard", spaces: "Spaces") -> "tuple[Imported, bool | None]":
    from repaint_cli.zoo.importers import cleanrl

    return cleanrl.read(file, spaces)


SOURCES: "dict[str, Callable[[Path, TaskCard, Spaces], tuple[Imported, bool | None]]]" = {
    "sb3": _read_sb3,
    "cleanrl": _read_cleanrl,
}
"""Other libraries, and what reads their policies: from a file, the card of its task and what
policies of that read and write, into the policy, and whether it was trained on normalised
observations, where that is known."""


class AddOptions(NamedTuple):
    """The options of `repaint zoo add`, in the order of its help."""

    name: Annotated[str, argument("NAME", "What to call the teacher.")]
    file: Annotated[Path, argument("FILE", "A teacher's file, or a policy of another library.")]
    source: Annotated[
        str | None,
        option(
            IMPORT,
            "|".join(SOURCES),
            "The library: a zip of Stable-Baselines3, or a state dict of a cleanrl agent.",
            "--from",
        ),
    ] = None
    task: Annotated[
        str | None, option(IMPORT, "TASK", "The task it was trained on, where it is scored.")
    ] = None
    vecnormalize: Annotated[
        str | None,
        option(
            IMPORT,
            "FILE|none",
            "How observations were normalised: VecNormalize's file, or an .npz with mean and var.",
        ),
    ] = None
    rescale_actions: Annotated[
        bool,
        option(
            IMPORT,
            None,
            "It was trained behind Gymnasium's RescaleAction: rescale its actions to the task's.",
            "--rescale-actions",
        ),
    ] = False
    replace: Replace = False


@parsed_into(AddOptions)
def add(options: AddOptions) -> None:
    """Put a policy's file into your zoo as a teacher.

    Nothing in the file is run: PPO, A2C and TRPO of Stable-Baselines3 with MlpPolicy or CnnPolicy,
    and agents of cleanrl's PPO scripts, are read as data; what cannot be the same is refused.

    Examples:
        repaint zoo add my-teacher teacher.safetensors
        repaint zoo add my-teacher model.zip --from sb3 --task reacher
    """
    from repaint_cli.cli.printing import out, print_written
    from repaint_cli.files.paths import user_zoo
    from repaint_cli.runs.start import new_teacher_name
    from repaint_cli.zoo import store

    name = new_teacher_name(options.name, options.replace)
    network, card = _read_own(options) if options.source is None else _import_policy(options)
    if options.source and card.score:
        out.print(f"score on {card.task.name}: {card.score}")
    card = card.model_copy(update={"name": name})
    path = store.add(network, 0, card, user_zoo(), replace=options.replace)
    target = options.task or card.task.name
    print_written([path], command("repaint transfer --teacher {} --task {}", name, target))


def _read_own(options: AddOptions) -> "tuple[ActorCritic, TeacherCard]":
    """Read a teacher's file, whose card says all that is needed.

    Raises:
        UsageError: an option for other libraries' files is given.
    """
    from repaint_cli.zoo.store import read_teacher

    imports = {
        "--task": options.task,
        "--vecnormalize": options.vecnormalize,
        "--rescale-actions": options.rescale_actions,
    }
    if given := next((name for name, value in imports.items() if value), None):
        raise UsageError(f"expected --from {' or '.join(SOURCES)} beside {given}, found none")
    return read_teacher(options.file)


def _import_policy(options: AddOptions) -> "tuple[ActorCritic, TeacherCard]":
    """Read another library's file, and score it on its task.

    Raises:
        NotFound: there is no such library or task.
        UsageError: --task is absent.
    """
    from repaint_cli.cli.console import literal
    from repaint_cli.cli.printing import out
    from repaint_cli.learn.evaluation import environment_spaces
    from repaint_cli.policies.spaces import Spaces
    from repaint_cli.tasks.card_files import read_task
    from repaint_cli.zoo.importers.fit import observation_notice
    from repaint_cli.zoo.importers.imported import as_teacher
    from repaint_cli.zoo.importers.statistics import statistics_of

    source, file = options.source or "", options.file
    if source not in SOURCES:
        raise NotFound.named("source", source, SOURCES, "repaint zoo add --help")
    if options.task is None:
        raise UsageError(f"expected the --task that {file} was trained on, found none")
    card = read_task(options.task)
    spaces = environment_spaces(card)
    policy, normalised = SOURCES[source](file, card, Spaces.of(*spaces))
    statistics = statistics_of(file, options.vecnormalize, normalised)
    teacher = as_teacher(
        policy, statistics, options.name, card, spaces, rescale=options.rescale_actions
    )
    if notice := observation_notice(policy.obs_bounds, spaces[0], card.name):
        out.print(f"[yellow]warning:[/yellow] {literal(notice)}")
    return teacher
