"""Options that several commands share, and how they change a card."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from repaint_cli.errors import CardError, NotFound
from repaint_cli.methods import METHODS

if TYPE_CHECKING:
    from repaint_cli.tasks import TaskCard

Task = Annotated[
    str, typer.Option(help="A task's name (repaint tasks list) or a card of your own.")
]
Iterations = Annotated[
    int | None, typer.Option(help="Iterations of training; default: the card's.")
]
Seeds = Annotated[int, typer.Option(help="How many seeds to train side by side.")]
Seed = Annotated[int, typer.Option(help="The first seed; the others follow it.")]
EvalEpisodes = Annotated[
    int | None, typer.Option(help="Episodes per evaluation; default: the card's.")
]
Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="<x.y=z>",
        help="Any other setting, as section.key=value (repaint tasks show TASK).",
    ),
]
RunFolder = Annotated[
    Path | None, typer.Option("--run", help="The run's folder; default: runs/TASK/METHOD-…")
]
TensorBoard = Annotated[
    bool, typer.Option("--tensorboard", help="Also write TensorBoard events to the run's folder.")
]


def customize(
    task: "TaskCard",
    settings: list[str] | None,
    **options: object,
) -> "TaskCard":
    """Return the card with --set and named options applied; an option of None changes nothing.

    Args:
        task: the card.
        settings: `section.key=value` texts.
        options: `section__key=value`.
    """
    named = [
        f"{key.replace('__', '.')}={value}" for key, value in options.items() if value is not None
    ]
    return task.with_settings(named + (settings or []))


def seed_list(first: int, how_many: int) -> list[int]:
    """Return the run seeds.

    Raises:
        CardError: there would be none, or a negative one.
    """
    if how_many < 1 or first < 0:
        raise CardError(
            f"expected --seeds of at least 1 and --seed of at least 0, found {how_many} and {first}"
        )
    return list(range(first, first + how_many))


def parse_ratio(text: str | None) -> tuple[int | None, int | None]:
    """Read R:I.

    Raises:
        CardError: it is something else, or R is 0: nothing would train the critic.
    """
    if text is None:
        return None, None
    parts = text.split(":")
    if len(parts) != 2 or not all(part.isdecimal() for part in parts) or int(parts[0]) < 1:
        raise CardError(
            "expected --ratio R:I, R representation iterations (at least 1, someone must train the "
            f"critic) then I instance iterations, such as 1:1 or 2:1; found '{text}'"
        )
    return int(parts[0]), int(parts[1])


def check_method(name: str, **given: object) -> None:
    """Check that there is such a method, and that it uses the options it is given.

    Raises:
        NotFound: there is no such method.
        CardError: it leaves out what an option is about.
    """
    if name not in METHODS:
        raise NotFound.named("method", name, METHODS, "repaint transfer --help")
    method = METHODS[name]
    used = {
        "ratio": method.alternates,
        "beta": method.kickstart,
        "beta_decay": method.kickstart,
        "threshold": method.instance,
        "transfer_iterations": method.kickstart or method.instance,
    }
    for option, value in given.items():
        if value is not None and not used[option]:
            raise CardError(
                f"expected an option that method '{name}' uses, found "
                f"--{option.replace('_', '-')}; leave it out or choose another --method"
            )
