"""`repaint reproduce NAME… | list | copy`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from repaint_cli.cli import completion
from repaint_cli.cli.help_page import HelpPage
from repaint_cli.cli.option_rules import parsed_into
from repaint_cli.cli.options import argument
from repaint_cli.cli.reproduce_options import ReproduceOptions

if TYPE_CHECKING:
    from repaint_cli.experiments.schema import Experiment

RUN = "run"
"""The command that may be left out."""


class NamesFirst(TyperGroup):
    """A group whose command `run` may be left out: `repaint reproduce reacher`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the command line, with `run` before it where no command is named."""
        if args and args[0] not in {*self.commands, *self.get_help_option_names(ctx)}:
            args = [RUN, *args]
        rest: list[str] = super().parse_args(ctx, args)
        return rest


reproduce = typer.Typer(
    cls=NamesFirst, no_args_is_help=True,
    help="Reproduce the paper's figures and tables, or experiments of your own.",
)  # fmt: skip


@reproduce.command("list", cls=HelpPage)
def list_experiments() -> None:
    """List the experiments, and how much is trained at each scale.

    That is seeds × iterations of each variant in each panel, as in the paper's item.

    Examples:
        repaint reproduce list
        repaint reproduce list | less
    """
    from repaint_cli.cli.console import columns
    from repaint_cli.experiments.files import list_experiments

    rows = [
        (one.name, one.item, *(_size(one, scale) for scale in ("night", "paper")), one.summary)
        for one in list_experiments()
    ]
    print(columns(("experiment", "item", "night", "paper", "what it shows"), rows, fit=True))


def _size(experiment: "Experiment", scale: str) -> str:
    if experiment.gathers:
        return "others"
    if scale not in experiment.scale_names:
        return "-"
    own = experiment.scale(scale)
    return f"{own.seeds}×{own.iterations}"


@reproduce.command(cls=HelpPage)
def copy(
    name: Annotated[
        str,
        argument("NAME", "An experiment's name.", autocompletion=completion.experiments),
    ],
    file: Annotated[Path, argument("FILE", "The new experiment, such as my.toml.")],
) -> None:
    """Copy an experiment to a file of your own to edit.

    Examples:
        repaint reproduce copy reacher my.toml
        repaint reproduce copy single-car-zeta my-sweep.toml
    """
    from repaint_cli.cli.console import plain
    from repaint_cli.experiments.files import copy_experiment
    from repaint_cli.files.commands import command

    copy_experiment(name, file)
    following = command("repaint reproduce {} --scale smoke", file)
    print(plain(f"wrote {file}\nnext: {following}"))


@reproduce.command(RUN, cls=HelpPage)
@parsed_into(ReproduceOptions)
def run(options: ReproduceOptions) -> None:
    """Train, draw and table experiments; the word run may be left out.

    What has been trained is not trained again: stopped or killed, type the same command to go on.

    Examples:
        repaint reproduce run reacher --scale smoke
        repaint reproduce run all --scale night --jobs 2
    """
    from repaint_cli.cli.reproduce_screen import carry_out

    carry_out(options)
