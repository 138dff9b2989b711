"""`repaint`: the commands, and the one place where an error becomes a line and an exit code."""

import signal
import sys
from typing import Annotated

import typer
from typer.exceptions import Abort, TyperException

from repaint_cli import __version__, interruption
from repaint_cli.cli.compare import compare
from repaint_cli.cli.evaluate import evaluate
from repaint_cli.cli.help_page import HelpPage
from repaint_cli.cli.open import open_page
from repaint_cli.cli.output import drop_output, guard_output
from repaint_cli.cli.reproduce import reproduce
from repaint_cli.cli.similarity import similarity
from repaint_cli.cli.status import status
from repaint_cli.cli.tasks import tasks
from repaint_cli.cli.train_teacher import train_teacher
from repaint_cli.cli.transfer import transfer
from repaint_cli.cli.zoo import zoo
from repaint_cli.errors import OutputError, RepaintError, Terminated

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # its boxes take longer to import than everything else
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("train-teacher", cls=HelpPage)(train_teacher)
app.command("transfer", cls=HelpPage)(transfer)
app.command("eval", cls=HelpPage)(evaluate)
app.command("similarity", cls=HelpPage)(similarity)
app.command("compare", cls=HelpPage)(compare)
app.command("status", cls=HelpPage)(status)
app.command("open", cls=HelpPage)(open_page)
app.add_typer(reproduce, name="reproduce")
app.add_typer(tasks, name="tasks")
app.add_typer(zoo, name="zoo")

DEBUG = "--debug"


def _show_version(wanted: bool) -> None:
    if wanted:
        print(f"repaint {__version__}")
        raise typer.Exit


@app.callback()
def about(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version."),
    ] = False,
    debug: Annotated[bool, typer.Option(DEBUG, help="Show an error's traceback.")] = False,
) -> None:
    """Train teacher policies, keep them in a zoo, and transfer them to new tasks with REPAINT."""


def main() -> None:
    """Run a command; turn what the program can explain into one line on stderr and an exit code."""
    interruption.listen()
    words = [word for word in sys.argv[1:] if word != DEBUG]
    try:
        guard_output()
        code = app(words or ["--help"], standalone_mode=False)
        sys.stdout.flush()
        sys.exit(code)
    except RepaintError as error:
        if isinstance(error, OutputError):
            drop_output()
        if DEBUG in sys.argv:
            raise
        _print_error(str(error))
        sys.exit(error.exit_code)
    except TyperException as error:
        if error.format_message():  # a group without a command shows its help instead
            command = getattr(getattr(error, "ctx", None), "command_path", "repaint")
            _print_error(f"{error.format_message()} See: {command} --help")
        sys.exit(2)
    except (KeyboardInterrupt, Abort):
        sys.exit(130)
    except Terminated:
        sys.exit(128 + signal.SIGTERM)
    except BrokenPipeError:  # the reader has ended, as head does
        drop_output()
        sys.exit(128 + signal.SIGPIPE)


def _print_error(message: str) -> None:
    from rich.console import Console

    from repaint_cli.cli.console import literal

    Console(stderr=True, soft_wrap=True).print(f"[red]error:[/red] {literal(message)}", emoji=False)
