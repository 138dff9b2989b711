"""`repaint zoo list | show | verify`."""

import json
from typing import Annotated

import typer

from repaint_cli.errors import CardError, CheckpointError
from repaint_cli.paths import user_zoo

zoo = typer.Typer(no_args_is_help=True, help="List, show and verify teachers.")
Name = Annotated[str, typer.Argument(help="A teacher's name or file.")]


@zoo.command("list")
def list_teachers(
    fits: Annotated[str | None, typer.Option(help="Only teachers that fit this task.")] = None,
) -> None:
    """List teachers: your own first, then the shipped ones."""
    from rich.console import Console
    from rich.table import Table

    from repaint_cli.cli.words import literal
    from repaint_cli.zoo import find, read_card, teachers

    table = Table("teacher", "task", "score [95 % CI]", "steps", "whose", box=None)
    chosen = _fitting(fits) if fits else list(teachers())
    for name in chosen:
        path = find(name)
        whose = "yours" if path.parent == user_zoo() else "shipped"
        try:
            card = read_card(path)
        except CheckpointError:
            table.add_row(literal(name), "damaged", "-", "-", whose)
            continue
        score = card.score
        text = f"{score.mean:.4g} [{score.low:.4g}, {score.high:.4g}]" if score else "-"
        table.add_row(literal(name), literal(card.task.name), text, f"{card.env_steps:,}", whose)
    Console(soft_wrap=True, emoji=False).print(table)


def _fitting(task: str) -> list[str]:
    from repaint_cli.cards import read_task
    from repaint_cli.evaluate import spaces_of
    from repaint_cli.zoo import fitting

    card = read_task(task)
    return fitting(card, spaces_of(card))


@zoo.command()
def show(name: Name) -> None:
    """Show a teacher's card."""
    from repaint_cli.zoo import find, read_card

    print(json.dumps(read_card(find(name)).model_dump(mode="json"), indent=2))


@zoo.command()
def verify(
    name: Annotated[str | None, typer.Argument(help="A teacher's name or file; none: all.")] = None,
) -> None:
    """Check that teachers are sound.

    A whole file, finite weights, a sound card, leaves of the right shapes.
    """
    from repaint_cli.cli.words import plain
    from repaint_cli.zoo import find, load_teacher, teachers

    names = [name] if name else list(teachers())
    bad = []
    for each in names:
        try:
            load_teacher(find(each))
            print(f"{plain(each)}: sound")
        except (CheckpointError, CardError) as error:
            bad.append(f"{each}: {error}")
    if bad:
        raise CheckpointError("; ".join(bad))
