"""`repaint zoo list | show | verify | export | remove`; `add` has a file of its own."""

import json
import shlex
from pathlib import Path
from typing import Annotated

import typer

from repaint_cli.cli.zoo_add import add
from repaint_cli.errors import CardError, CheckpointError
from repaint_cli.paths import user_zoo

zoo = typer.Typer(no_args_is_help=True, help="List, show, check, add, export, remove teachers.")
zoo.command("add")(add)
Name = Annotated[str, typer.Argument(help="A teacher's name or file.")]


@zoo.command("list")
def list_teachers(
    fits: Annotated[str | None, typer.Option(help="Only teachers that fit this task.")] = None,
) -> None:
    """List teachers: your own first, then the shipped ones."""
    from repaint_cli.cli.console import columns
    from repaint_cli.zoo.store import teachers

    known, home = teachers(), user_zoo()
    names = _fitting(fits) if fits else list(known)
    rows = [(name, *_seen(known[name]), _whose(known[name], home)) for name in names]
    print(columns(("teacher", "task", "score [95 % CI]", "steps", "whose"), rows))


def _seen(path: Path) -> tuple[str, str, str]:
    from repaint_cli.zoo.teacher_card import read_summary

    try:
        task, score, steps = read_summary(path)
    except CheckpointError:
        return "damaged", "-", "-"
    text = "{:.4g} [{:.4g}, {:.4g}]".format(*score) if score else "-"
    return task, text, f"{steps:,}"


def _whose(path: Path, home: Path) -> str:
    return "yours" if path.parent == home else "shipped"


def _fitting(task: str) -> list[str]:
    from repaint_cli.learn.evaluation import spaces_of
    from repaint_cli.tasks.card_files import read_task
    from repaint_cli.zoo.store import fitting

    card = read_task(task)
    return fitting(card, spaces_of(card))


@zoo.command()
def show(
    name: Name,
    markdown: Annotated[
        bool, typer.Option("--markdown", help="As a page to publish beside the file.")
    ] = False,
) -> None:
    """Show a teacher's card."""
    from repaint_cli.cli.console import plain
    from repaint_cli.zoo import model_card
    from repaint_cli.zoo.store import find
    from repaint_cli.zoo.teacher_card import read_card

    path = find(name)
    card = read_card(path)
    if markdown:
        print(plain(model_card.markdown(card, path)), end="")
    else:
        print(json.dumps(card.model_dump(mode="json"), indent=2))


@zoo.command()
def verify(
    name: Annotated[str | None, typer.Argument(help="A teacher's name or file; none: all.")] = None,
    score: Annotated[bool, typer.Option("--score", help="Measure the score once more.")] = False,
) -> None:
    """Check that teachers are sound.

    A whole file with the hash it was written with, finite weights of the right shapes, a sound
    card, a policy that fits its own task.
    """
    from repaint_cli.cli.console import plain
    from repaint_cli.zoo.store import find, teachers
    from repaint_cli.zoo.verify import verify

    names = [name] if name else list(teachers())
    bad = []
    for each in names:
        path = find(each)
        try:
            print(plain(f"{each}: {verify(path, again=score)}"))
        except (CheckpointError, CardError) as error:
            bad.append(f"{each}: {error}")
    if bad:
        raise CheckpointError("; ".join(bad))


@zoo.command()
def export(
    name: Name,
    folder: Annotated[Path, typer.Argument(help="Where to; it is made where it is absent.")],
    onnx: Annotated[bool, typer.Option("--onnx", help="Write the policy as ONNX, too.")] = False,
) -> None:
    """Write a teacher, card.json and a page to a folder."""
    from repaint_cli.cli.session import say_written
    from repaint_cli.zoo.export import export
    from repaint_cli.zoo.store import find

    written = export(find(name), folder, onnx=onnx)
    say_written(written, f"repaint zoo verify {shlex.quote(str(written[0]))}")


@zoo.command()
def remove(
    name: Annotated[str, typer.Argument(help="The name of one of your own teachers.")],
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask.")] = False,
) -> None:
    """Remove one of your own teachers, after asking."""
    from repaint_cli.cli.console import agreed, plain
    from repaint_cli.zoo.store import remove

    if yes or agreed(f"Remove the teacher '{plain(name)}' from your zoo for good?"):
        print(f"removed {remove(name)}")
    else:
        print("nothing removed")
