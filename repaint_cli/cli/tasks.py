"""`repaint tasks list | show | copy | new | check | trust`; `track` and `replay` lie beside it."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from repaint_cli.cli import completion
from repaint_cli.cli.from_drfc import from_drfc
from repaint_cli.cli.help_page import OPTIONS, HelpPage
from repaint_cli.cli.options import Yes, argument, option
from repaint_cli.cli.replay import replay
from repaint_cli.cli.track import track

if TYPE_CHECKING:
    from repaint_cli.settings import PPOConfig
    from repaint_cli.tasks.card import TaskCard

tasks = typer.Typer(
    no_args_is_help=True,
    help="List, show, copy, write, check task cards; replay logs; trust a run.",
)
tasks.add_typer(track, name="track")
tasks.command("from-drfc", cls=HelpPage)(from_drfc)
tasks.command(cls=HelpPage)(replay)
TaskName = Annotated[
    str,
    argument(
        "TASK",
        "A task's name, or the file of a card of your own.",
        autocompletion=completion.tasks,
    ),
]


@tasks.command("list", cls=HelpPage)
def list_tasks() -> None:
    """List the shipped tasks, and what their training costs.

    That is so many iterations × so many steps or episodes in each.

    Examples:
        repaint tasks list
        repaint tasks list | less
    """
    from repaint_cli.cli.console import columns
    from repaint_cli.files.paths import shipped_tasks
    from repaint_cli.tasks.card_files import read_task

    cards = map(read_task, shipped_tasks())
    rows = [(c.name, c.env.simulator, training(c.ppo), c.summary) for c in cards]
    print(columns(("task", "simulator", "training", "what it is"), rows, fit=True))


def training(ppo: "PPOConfig") -> str:
    """Return how many iterations a training has, and what a seed plays in each."""
    each = f"{ppo.n_episodes:,} episodes" if ppo.n_episodes else f"{ppo.n_steps:,} steps"
    return f"{ppo.n_iterations:,} × {each}"


@tasks.command(cls=HelpPage)
def show(
    name: TaskName,
    preset: Annotated[
        str | None,
        option(OPTIONS, "NAME", "paper or coach: show its numbers, and whose each of them is."),
    ] = None,
) -> None:
    """Show a task's settings, all of them, with what each means: a card as TOML.

    Examples:
        repaint tasks show reacher
        repaint tasks show racer-outer --preset paper
    """
    from repaint_cli.cli.console import literal
    from repaint_cli.cli.printing import out
    from repaint_cli.tasks.card_files import read_task
    from repaint_cli.tasks.card_text import explained
    from repaint_cli.tasks.paper import sources
    from repaint_cli.tasks.presets import with_preset

    card = with_preset(read_task(name), preset)
    for line in explained(card, dict(sources(card)) if preset else None):
        style = "dim" if line.startswith("#") else "bold" if line.startswith("[") else ""
        out.print(literal(line), style=style)


@tasks.command(cls=HelpPage)
def copy(
    name: TaskName, file: Annotated[Path, argument("FILE", "The new card, such as my-task.toml.")]
) -> None:
    """Copy a task's card, whole, to a file of your own to edit.

    Examples:
        repaint tasks copy reacher my-task.toml
        repaint tasks copy racer-outer my-race.toml
    """
    from repaint_cli.tasks.card_files import read_task
    from repaint_cli.tasks.card_text import to_toml

    card = read_task(name)
    check_new(file)
    _write_card(file, to_toml(card), "repaint train-teacher --task {}")


@tasks.command(cls=HelpPage)
def new(
    file: Annotated[Path, argument("FILE", "The new card, such as my-task.toml.")],
    env: Annotated[str, option(OPTIONS, "ID", "The environment's id, as in gymnasium.make.")],
) -> None:
    """Write a card for an environment of Gymnasium.

    It is played with random actions to find the terms of its reward.

    Examples:
        repaint tasks new --env HalfCheetah-v5 my-task.toml
        repaint tasks new --env my_package:Walker-v0 walker.toml
    """
    from repaint_cli.cli.new_card import new_card

    check_new(file)
    _write_card(file, new_card(env), "repaint tasks check {}")


def check_new(file: Path) -> None:
    """Check that a card may be written there.

    Raises:
        StoreError: it is no file of TOML, or is there already.
    """
    from repaint_cli.errors import StoreError

    if file.suffix != ".toml":
        raise StoreError(f"expected a file that ends in .toml, found '{file}'")
    if os.path.lexists(file):
        raise StoreError(f"{file} exists already; give another name")


def _write_card(file: Path, text: str, form: str) -> None:
    """Write a new card; print the next command, by its form."""
    from repaint_cli.cli.console import plain
    from repaint_cli.files.atomic import write_text
    from repaint_cli.files.commands import command

    write_text(file, text, new=True)
    print(plain(f"wrote {file}\nnext: {command(form, file)}"))


@tasks.command(cls=HelpPage)
def check(
    name: Annotated[
        str, argument("TASK", "A task's name, a card's file, or a file of waypoints (.npy).")
    ],
    engine: Annotated[
        str | None,
        option(
            OPTIONS,
            "NAME",
            "Instead, play a fixed script in this engine of the task's simulator and in its own, "
            "and print both timelines.",
        ),
    ] = None,
) -> None:
    """Check a card, or check and draw a track.

    A card is tried by whole episodes of the policy that training begins with.

    Examples:
        repaint tasks check my-task.toml
        repaint tasks check my-track.npy
    """
    from repaint_cli.cli.console import plain
    from repaint_cli.envs.registry import simulator_classes
    from repaint_cli.files.foreign import check_replaceable
    from repaint_cli.tasks.card_files import read_task

    for simulator in simulator_classes():
        if checked := simulator.check_file(name):
            print(plain(f"{checked.name} is sound: {checked.facts}"))
            if checked.note:
                print(plain(f"note: {checked.note}"))
            check_replaceable([checked.picture], advice="move it, or check from another folder")
            checked.draw()
            print(plain(f"wrote {checked.picture}\nnext: {checked.next_command}"))
            return
    card = read_task(name)
    if engine is None:
        _check_card(name, card)
        return
    for line in card.env.beside(engine):
        print(plain(line))


def _check_card(name: str, card: "TaskCard") -> None:
    """Print what training would stumble over, a line each, or that there is nothing.

    Raises:
        RepaintError: training would end with an error; all of them are its lines.
    """
    from repaint_cli.cli.console import plain
    from repaint_cli.learn.task_check import check_task
    from repaint_cli.tasks.card_files import notes_on_files

    checked = check_task(card)
    for warning in checked.warnings:
        print(f"warning: {plain(warning)}")
    if checked.errors:
        raise type(checked.errors[0])("\n".join(map(str, checked.errors)))
    terms = plain(", ".join(f"{term} {paid:.4g}" for term, paid in checked.mean_terms.items()))
    n_episodes = len(checked.returns)
    print(
        f"{card.name} is sound: {checked.spaces}; {n_episodes} episodes of a first policy have "
        f"{checked.n_steps / n_episodes:.4g} steps on average, at most "
        f"{card.env.longest_episode():,}; reward terms of a step: {terms}"
    )
    for note in notes_on_files(name, card) + checked.notes:
        print(f"note: {plain(note)}")


@tasks.command(cls=HelpPage)
def trust(
    run: Annotated[Path, argument("RUN", "The folder of a run by somebody else.")],
    yes: Yes = False,
) -> None:
    """Let a run by somebody else run its code here.

    That is a reward function, or a module that its environment is in; it is shown first.

    Examples:
        repaint tasks trust downloaded-run
        repaint tasks trust downloaded-run --yes
    """
    from repaint_cli.cli.console import confirm, plain
    from repaint_cli.runs.mended import mended_task
    from repaint_cli.runs.reader import read_run
    from repaint_cli.tasks import trust

    task = mended_task(read_run(run))
    code = task.code_at_risk()
    if code is None:
        print("nothing to allow: it brings no code along")
        return
    if task.reward_code:
        print(plain(task.reward_code.source))
    if yes or confirm(f"Let {plain(code)} run here?"):
        trust.allow(task)
        print(f"allowed: {plain(code)}")
    else:
        print("nothing allowed")
