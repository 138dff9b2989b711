"""`repaint zoo list | show | verify | export | remove`; `add` has a file of its own."""

from pathlib import Path
from typing import Annotated

import typer

from repaint_cli.cli import completion
from repaint_cli.cli.help_page import OPTIONS, HelpPage
from repaint_cli.cli.options import ReplaceFiles, Yes, argument, option
from repaint_cli.cli.zoo_add import add
from repaint_cli.cli.zoo_rank import rank
from repaint_cli.errors import CardError, CheckpointError, some
from repaint_cli.files.commands import command

zoo = typer.Typer(no_args_is_help=True, help="List, show, check, add, export, remove teachers.")
zoo.command("add", cls=HelpPage)(add)
zoo.command("rank", cls=HelpPage)(rank)
TeacherName = Annotated[
    str,
    argument("TEACHER", "A teacher's name or file.", autocompletion=completion.teachers),
]


@zoo.command("list", cls=HelpPage)
def list_teachers(
    fits: Annotated[
        str | None,
        option(
            OPTIONS,
            "TASK",
            "Only teachers that fit this task.",
            autocompletion=completion.tasks,
        ),
    ] = None,
) -> None:
    """List teachers: your own first, then the shipped ones.

    Examples:
        repaint zoo list
        repaint zoo list --fits racer-outer
    """
    from repaint_cli.cli.console import columns
    from repaint_cli.zoo.store import teachers, whose

    known = teachers()
    names = _fitting(fits) if fits else list(known)
    rows = [(name, *_summary(known[name]), whose(known[name])) for name in names]
    print(columns(("teacher", "task", "score [95 % CI]", "steps", "whose"), rows))


def _summary(path: Path) -> tuple[str, str, str]:
    from repaint_cli.zoo.teacher_card import interval_text, read_summary

    try:
        task, score, steps = read_summary(path)
    except CheckpointError:
        return "damaged", "-", "-"
    return task, interval_text(*score) if score else "-", f"{steps:,}"


def _fitting(task: str) -> list[str]:
    from repaint_cli.learn.evaluation import spaces_of
    from repaint_cli.tasks.card_files import read_task
    from repaint_cli.zoo.store import fitting

    card = read_task(task)
    return list(fitting(card, spaces_of(card)))


@zoo.command(cls=HelpPage)
def show(
    name: TeacherName,
    markdown: Annotated[
        bool, option(OPTIONS, None, "Write a page to publish beside the file.", "--markdown")
    ] = False,
    as_json: Annotated[bool, option(OPTIONS, None, "Print all of its card.", "--json")] = False,
) -> None:
    """Show a teacher's card in ten lines, or all of it.

    Examples:
        repaint zoo show racer-inner
        repaint zoo show racer-inner --json
    """
    import json

    from repaint_cli.cli.console import plain
    from repaint_cli.cli.namesakes import print_notes
    from repaint_cli.cli.teacher_table import lines
    from repaint_cli.zoo import model_card
    from repaint_cli.zoo.store import find
    from repaint_cli.zoo.teacher_card import read_card

    path = find(name)
    print_notes(name)
    card = read_card(path)
    if markdown:
        print(plain(model_card.markdown(card, path)), end="")
    elif as_json:
        print(json.dumps(card.model_dump(mode="json"), indent=2))
    else:
        print("\n".join(lines(card, path)))
        print(plain("next: " + command("repaint zoo show {} --json", name)))


@zoo.command(cls=HelpPage)
def verify(
    name: Annotated[
        str | None, argument("TEACHER", "A teacher's name or file. Default: all teachers.")
    ] = None,
    score: Annotated[
        bool, option(OPTIONS, None, "Also measure the score once more.", "--score")
    ] = False,
) -> None:
    """Check that teachers are sound.

    A whole file with the hash it was written with, finite weights of the right shapes, a sound
    card, a policy that fits its own task.

    Examples:
        repaint zoo verify
        repaint zoo verify racer-inner --score
    """
    from repaint_cli.cli.console import plain
    from repaint_cli.cli.namesakes import print_notes
    from repaint_cli.zoo.store import find, teachers
    from repaint_cli.zoo.verify import verify

    names = [name] if name else list(teachers())
    print_notes(*([name] if name else []))
    bad = []
    for each in names:
        path = find(each)
        try:
            print(plain(f"{each}: {verify(path, again=score)}"))
        except (CheckpointError, CardError) as error:
            bad.append(f"{each}: {error}")
    if bad:
        raise CheckpointError(some(bad, between="; "))


@zoo.command(cls=HelpPage)
def export(
    name: TeacherName,
    folder: Annotated[
        Path, argument("FOLDER", "The folder to write to; it is made where there is none.")
    ],
    onnx: Annotated[
        bool, option(OPTIONS, None, "Also write the policy as ONNX.", "--onnx")
    ] = False,
    replace: ReplaceFiles = False,
) -> None:
    """Write a teacher, card.json and a page to a folder.

    Examples:
        repaint zoo export racer-inner my-folder
        repaint zoo export racer-inner my-folder --onnx
    """
    from repaint_cli.cli.namesakes import print_notes
    from repaint_cli.cli.printing import print_written
    from repaint_cli.zoo.export import export
    from repaint_cli.zoo.store import find

    print_notes(name)
    written = export(find(name), folder, onnx=onnx, replace=replace)
    print_written(written, command("repaint zoo verify {}", written[0]))


@zoo.command(cls=HelpPage)
def remove(
    name: Annotated[str, argument("TEACHER", "The name of one of your own teachers.")],
    yes: Yes = False,
) -> None:
    """Remove one of your own teachers, after asking.

    Examples:
        repaint zoo remove my-teacher
        repaint zoo remove my-teacher --yes
    """
    from repaint_cli.cli.console import confirm, plain
    from repaint_cli.zoo.store import remove

    if yes or confirm(f"Remove the teacher '{plain(name)}' from your zoo for good?"):
        print(f"removed {remove(name)}")
    else:
        print("nothing removed")
