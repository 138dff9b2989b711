"""What is shown of several runs while they train: those that train now, and how many wait."""

from collections.abc import Sequence
from pathlib import Path
from time import monotonic

from rich.console import Console

from repaint_cli.cli.console import literal
from repaint_cli.cli.status_table import status_table
from repaint_cli.engines.engine import Outcome
from repaint_cli.engines.options import RunsWatcher
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.status import FINISHED, WAITING, statuses_of, summary_of

SECONDS = 2.0
"""Between two looks into their folders."""
MOST = 12
"""Runs that are shown at a time."""


class RunsScreen(RunsWatcher):
    """Prints each run that ends, and holds a table of those that train."""

    def __init__(self, screen: Console) -> None:
        self._screen = screen
        self._plans: Sequence[Plan] = ()
        self._ended = 0
        self._shown, self._text = 0.0, ""

    def training(self, plans: Sequence[Plan]) -> None:
        """These are carried out from now on."""
        self._plans, self._ended, self._shown = plans, 0, 0.0

    def notice(self, text: str) -> None:
        """Print what is to be known."""
        self._screen.print(f"[yellow]warning:[/yellow] {literal(text)}")

    def failed(self, outcome: Outcome) -> None:
        """Print which run failed, and why."""
        self._ended += 1
        self._screen.print(
            f"[red]failed:[/red] {literal(outcome.folder)}: {literal(outcome.reason)}"
        )

    def wrote(self, folder: Path) -> None:
        """Print that a run is finished."""
        self._ended += 1
        count = f"{self._ended} of {len(self._plans)}"
        self._screen.print(f"{count}: wrote [bold]{literal(folder)}/[/bold]")

    def table(self) -> str:
        """Return how far the runs are; empty for a single one, which shows that itself."""
        plans = self._plans
        if len(plans) < 2:
            return ""
        if monotonic() - self._shown > SECONDS:
            rows = statuses_of({plan.folder: plan.task.ppo.n_iterations for plan in plans})
            active = [row for row in rows if row.state not in (WAITING, FINISHED)][:MOST]
            table = status_table(active, plans[0].folder.parent) + "\n" if active else ""
            self._text, self._shown = table + summary_of(rows), monotonic()
        return self._text
