"""Options that several commands share, and the headings they stand under in help."""

from pathlib import Path
from typing import Annotated, Any

import typer

from repaint_cli.cli import completion
from repaint_cli.cli.help_page import OPTIONS
from repaint_cli.cli.option_rules import Rule

ARGUMENTS = "Arguments"
WHAT = "What to learn"
WHOM = "From whom"
HOW = "How"
LONG = "How long"
WHERE = "Where to"
WRITE = "What to write"


def option(heading: str, metavar: str | None, sentence: str, *flags: str, **more: Any) -> Any:
    """Return typer's part of an option's row.

    Args:
        heading: what it stands under in help.
        metavar: what follows it; None for a switch.
        sentence: what it does.
        flags: how it is typed, where that is not its name.
        more: further arguments of `typer.Option`.
    """
    return typer.Option(*flags, metavar=metavar, help=sentence, rich_help_panel=heading, **more)


def argument(metavar: str, sentence: str, heading: str = ARGUMENTS, **more: Any) -> Any:
    """Return typer's part of an argument's row; `more` are further arguments of typer's."""
    return typer.Argument(metavar=metavar, help=sentence, rich_help_panel=heading, **more)


TaskOption = Annotated[
    str | None,
    option(
        WHAT,
        "TASK",
        "A task's name (repaint tasks list), or a card's file.",
        autocompletion=completion.tasks,
    ),
]
Preset = Annotated[
    str | None,
    option(
        HOW,
        "NAME",
        "paper: the paper's numbers; coach: and its framework's choices. Other options outrank it.",
    ),
    Rule(algorithms=("ppo",)),
]
Set = Annotated[
    list[str] | None,
    option(
        HOW,
        "SECTION.KEY=VALUE",
        "Any other setting of the card (repaint tasks show TASK); again for several.",
    ),
    Rule(list),
]
Iterations = Annotated[
    int | None,
    option(LONG, "INT", "Iterations of training. Default: the card's."),
    Rule("ppo.n_iterations", resumable=True),
]
Seeds = Annotated[int, option(LONG, "INT", "How many seeds to train side by side.")]
Seed = Annotated[int, option(LONG, "INT", "The first seed; the others follow it.")]
EvalEpisodes = Annotated[
    int | None,
    option(LONG, "INT", "Episodes per evaluation. Default: the card's."),
    Rule("eval.episodes"),
]
Resume = Annotated[
    Path | None,
    option(
        LONG,
        "FOLDER",
        "Continue the run in this folder as it began, perhaps for more --iterations.",
        autocompletion=completion.runs,
    ),
    Rule(resumable=True),
]
RunFolderOption = Annotated[
    Path | None, option(WHERE, "FOLDER", "The run's folder. Default: runs/TASK/METHOD-…")
]
Keep = Annotated[int, option(WHERE, "INT", "Checkpoints to keep, the newest ones.", min=1)]
TensorBoard = Annotated[
    bool,
    option(WHERE, None, "The same as --track tensorboard.", "--tensorboard"),
    Rule(resumable=True),
]
Track = Annotated[
    list[str] | None,
    option(WHERE, "TOOL", "Also draw its curves in tensorboard, wandb or mlflow; again for more."),
    Rule(resumable=True),
]
Device = Annotated[
    str,
    option(
        HOW, "NAME", "Where policies act and learn: cpu, cuda (an NVIDIA GPU) or auto.", "--device"
    ),
    Rule(resumable=True),
]
DryRun = Annotated[
    bool,
    option(HOW, None, "Print what would run, all settings and how long it takes.", "--dry-run"),
]
Replace = Annotated[
    bool,
    option(WHERE, None, "Replace a teacher of the given name in your zoo.", "--replace"),
    Rule(resumable=True),
]
ReplaceFiles = Annotated[
    bool, option(OPTIONS, None, "Replace files that repaint did not write.", "--replace")
]
AsJson = Annotated[bool, option(WRITE, None, "Print JSON.", "--json")]
Yes = Annotated[bool, option(OPTIONS, None, "Do not ask.", "--yes")]
