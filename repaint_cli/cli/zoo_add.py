"""`repaint zoo add`."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from repaint_cli.errors import CardError, NotFound

if TYPE_CHECKING:
    from repaint_cli.policies.networks import ActorCritic
    from repaint_cli.zoo.teacher_card import TeacherCard

SOURCES = ("sb3", "cleanrl")


def add(
    name: Annotated[str, typer.Argument(help="What to call the teacher.")],
    file: Annotated[Path, typer.Argument(help="A teacher's file, or a policy's from elsewhere.")],
    source: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="<sb3|cleanrl>",
            help="Whose file it is: a zip of Stable-Baselines3 or a state dict of a cleanrl agent; "
            "ours where absent.",
        ),
    ] = None,
    task: Annotated[
        str | None,
        typer.Option(help="With --from: the task it was trained on, where it is scored."),
    ] = None,
    vecnormalize: Annotated[
        str | None,
        typer.Option(
            metavar="<file|none>",
            help="With --from: how observations were normalised: VecNormalize's file, or an .npz "
            "with mean and var.",
        ),
    ] = None,
    replace: Annotated[
        bool, typer.Option("--replace", help="Replace a teacher of this name in your zoo.")
    ] = False,
) -> None:
    """Put a policy's file into your zoo as a teacher.

    Nothing in the file is run: PPO and A2C of Stable-Baselines3 with MlpPolicy or CnnPolicy, and
    agents of cleanrl's PPO scripts, are read as data; what cannot be read exactly is refused.
    """
    from repaint_cli.cli.screen import out
    from repaint_cli.cli.session import new_teacher_name, say_written
    from repaint_cli.paths import user_zoo
    from repaint_cli.zoo import store

    name = new_teacher_name(name, replace)
    if source is None:
        network, card = _ours(file, task, vecnormalize)
    else:
        network, card = _theirs(name, file, source, task, vecnormalize)
    if source and card.score:
        score = f"{card.score.mean:.4g} [{card.score.low:.4g}, {card.score.high:.4g}]"
        out.print(f"score on {card.task.name}: {score} over {card.score.episodes} episodes")
    card = card.model_copy(update={"name": name})
    path = store.add(network, 0, card, user_zoo(), replace=replace)
    target = shlex.quote(task or card.task.name)
    say_written([path], f"repaint transfer --teacher {name} --task {target}")


def _ours(
    file: Path, task: str | None, vecnormalize: str | None
) -> "tuple[ActorCritic, TeacherCard]":
    """Read a teacher's file, which says all of itself."""
    from repaint_cli.zoo.store import load_teacher

    if task or vecnormalize:
        option = "--task" if task else "--vecnormalize"
        raise CardError(f"expected --from {' or '.join(SOURCES)} beside {option}, found none")
    return load_teacher(file)


def _theirs(
    name: str, file: Path, source: str, task: str | None, vecnormalize: str | None
) -> "tuple[ActorCritic, TeacherCard]":
    """Read another library's file, and score it on its task."""
    from repaint_cli.learn.evaluation import spaces_of
    from repaint_cli.tasks.card_files import read_task
    from repaint_cli.zoo.importers import cleanrl, sb3
    from repaint_cli.zoo.importers.imported import as_teacher
    from repaint_cli.zoo.importers.statistics import statistics_of

    if source not in SOURCES:
        raise NotFound.named("source", source, SOURCES, "repaint zoo add --help")
    if task is None:
        raise CardError(f"expected the --task that {file} was trained on, found none")
    card = read_task(task)
    if source == "sb3":
        policy, normalised = sb3.read(file)
    else:
        policy, normalised = cleanrl.read(file, spaces_of(card))
    return as_teacher(policy, statistics_of(file, vecnormalize, normalised), name, card)
