"""What people see during a run: a live display on a terminal, a line per iteration elsewhere."""

from collections.abc import Sequence
from types import TracebackType

import numpy as np
from rich.console import Console, Group
from rich.live import Live
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.text import Text

from repaint_cli.cli.console import literal
from repaint_cli.runs.experiment import Experiment
from repaint_cli.runs.metrics import Report
from repaint_cli.runs.record import Alarm

out = Console(soft_wrap=True, highlight=False, emoji=False)


class Screen:
    """Shows an experiment's reports as they come."""

    def __init__(self, experiment: Experiment) -> None:
        plan = experiment.plan
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(compact=True),
            TextColumn("left"),
            console=out,
        )
        total, done = plan.task.ppo.n_iterations, experiment.learner.iteration
        what = f"{plan.method} · {literal(plan.task.name)}"
        self._bar = self._progress.add_task(what, total=total, completed=done)
        self._total = total
        self._numbers = Text(f"  iteration {done + 1} …", style="dim")
        self._live = Live(get_renderable=self._render, console=out, refresh_per_second=4)

    def _render(self) -> Group:
        return Group(self._progress, self._numbers)

    def __enter__(self) -> "Screen":
        if out.is_terminal:
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if out.is_terminal:
            self._live.stop()

    def show(self, report: Report, alarms: Sequence[Alarm] = ()) -> None:
        """Show an iteration's numbers, and what looks wrong."""
        numbers = numbers_of(report)
        if out.is_terminal:
            self._progress.update(self._bar, completed=report.stats.iteration)
            self._numbers = Text("  " + numbers)
        else:
            out.print(f"iteration {report.stats.iteration}/{self._total} · {numbers}")
        for alarm in alarms:
            out.print(f"[yellow]warning:[/yellow] {literal(alarm.text)}")


def numbers_of(report: Report) -> str:
    """Return an iteration's numbers in a line of at most 78 characters."""
    stats, played = report.stats, report.evaluation
    speed = stats.metrics["steps_per_second"][0]
    parts = [stats.phase, f"{speed:,.0f} steps/s", f"return {played.returns.mean():.4g}"]
    if played.progress is not None:
        parts.append(f"progress {played.progress.mean():.0f} %")
    if "kept_fraction" in stats.metrics:
        parts.append(f"kept {np.mean(stats.metrics['kept_fraction']):.2f}")
    return " · ".join(parts)
