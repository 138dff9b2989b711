"""What `repaint reproduce run` does and shows."""

import re
from collections.abc import Iterable, Sequence
from itertools import groupby

from rich.console import Console
from rich.table import Table

from repaint_cli.cli.console import literal
from repaint_cli.cli.engine_options import engine_options
from repaint_cli.cli.live import live
from repaint_cli.cli.printing import out, print_written
from repaint_cli.cli.reproduce_options import ReproduceOptions
from repaint_cli.cli.runs_screen import RunsScreen
from repaint_cli.engines.engine import Outcome
from repaint_cli.experiments.files import ALL, list_experiments, read_experiment
from repaint_cli.experiments.reproduce import ExperimentWatcher, Remaining, Reproduced, reproduce
from repaint_cli.experiments.schema import Experiment
from repaint_cli.experiments.tables import (
    MEANING,
    OVER_HEADS,
    OVER_MEANING,
    cells,
    heads_of,
    over_cells,
    summary,
)
from repaint_cli.experiments.training import Trained
from repaint_cli.files.commands import command
from repaint_cli.runs.comparison_words import duration
from repaint_cli.runs.plan import Plan

NARROW = (1, 3, 4, 5, 6)
"""The columns of an experiment's table that 80 columns have room for: variant … area."""

NARROW_OVER = (0, 1, 2, 5)
"""Those of the table over all panels: variant, panels, IQM, P(better)."""

INTERVAL = re.compile(r"(\[[^]]*), ")
"""Whose ends stand on one line."""


def carry_out(options: ReproduceOptions) -> None:
    """Carry out the experiments that are named, and print their numbers."""
    screen = Console(stderr=True, soft_wrap=True, highlight=False)
    experiments, how, printer = _named(options, screen), engine_options(options), _Printer(screen)
    with live(screen, note=printer.runs.table):
        reproduce(experiments, options.scale.value, options.into, how, printer, options.replace)


def _named(options: ReproduceOptions, screen: Console) -> list[Experiment]:
    """Return the experiments that are named, each once; of all those that have the scale."""
    named: dict[str, Experiment] = {}
    left_out = []
    for name in options.names:
        for one in list_experiments() if name == ALL else [read_experiment(name)]:
            if name == ALL and options.scale.value not in one.scale_names:
                left_out.append(one.name)
            else:
                named[one.name] = one
    if left_out:
        screen.print(f"left out, without a scale {options.scale}: {', '.join(left_out)}")
    return list(named.values())


class _Printer(ExperimentWatcher):
    """Prints what is to come, each run that is finished, and each experiment's numbers."""

    def __init__(self, screen: Console) -> None:
        self._screen, self.runs = screen, RunsScreen(screen)

    def begin(self, remaining: Sequence[Remaining]) -> None:
        for one in remaining:
            self._screen.print(literal(_line(one)))
        if len(remaining) > 1:
            runs, seconds = (
                sum(one.left for one in remaining),
                sum(one.seconds for one in remaining),
            )
            self._screen.print(f"all: {runs} runs to train, about {duration(seconds)} on two cores")

    def training(self, plans: Sequence[Plan]) -> None:
        self.runs.training(plans)

    def notice(self, text: str) -> None:
        self.runs.notice(text)

    def failed(self, outcome: Outcome) -> None:
        self.runs.failed(outcome)

    def trained(self, trained: Trained) -> None:
        run = trained.run
        self._screen.print(
            f"{trained.done} of {trained.total}: {literal(run.label)}, wrote "
            f"[bold]{literal(run.folder)}/[/bold]"
        )

    def finish(self, reproduced: Reproduced) -> None:
        experiment, scale = reproduced.planned.experiment, reproduced.planned.scale
        no_result = "; a trial, no result" if scale == "smoke" else ""
        out.print(
            f"[bold]{experiment.name}[/bold] ({literal(experiment.item)}), {scale}{no_result}"
        )
        if experiment.table == "rows":
            self._rows(reproduced)
        else:
            heads, lines = summary(reproduced.rows, time=experiment.table == "time")
            _print(heads, lines)
        if reproduced.over:
            cells_over = [over_cells(*one) for one in reproduced.over.items()]
            _print(
                [OVER_HEADS[i] for i in NARROW_OVER],
                [[c[i] for i in NARROW_OVER] for c in cells_over],
            )
            out.print(literal(OVER_MEANING), soft_wrap=False)
        for warning in reproduced.warnings:
            out.print(f"[yellow]warning:[/yellow] {literal(warning)}", soft_wrap=False)
        out.print(literal(MEANING), soft_wrap=False)
        following = command("repaint reproduce copy {} my.toml", experiment.file)
        larger = experiment.scale_names[experiment.scale_names.index(scale) + 1 :]
        if larger:
            following = reproduced.planned.command(larger[0])
        print_written(reproduced.written, following)

    def _rows(self, reproduced: Reproduced) -> None:
        """Print a table for each panel."""
        for panel, rows in groupby(reproduced.rows, key=lambda row: row.panel):
            own = list(rows)
            goal = "" if own[0].target is None else f", target {own[0].target:.4g}"
            out.print(literal(f"{panel}{goal}"))
            heads = heads_of(own)
            _print([heads[i] for i in NARROW], [[cells(row)[i] for i in NARROW] for row in own])


def _print(heads: Sequence[str], lines: Iterable[Sequence[str]]) -> None:
    table = Table(*heads, box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for column in table.columns:
        column.overflow = "fold"  # a name is never cut
    for line in lines:
        table.add_row(*(literal(INTERVAL.sub(r"\1,", text)) for text in line))
    out.print(table, soft_wrap=False)


def _line(one: Remaining) -> str:
    """Say what an experiment will train and how long that takes."""
    planned = one.planned
    runs = planned.all_runs()
    seeds = max(len(run.seeds) for run in planned.runs())
    iterations = max(run.card.ppo.n_iterations for run in planned.runs())
    return (
        f"{planned.experiment.name} ({planned.experiment.item}), {planned.scale}: {len(runs)} runs "
        f"of {seeds} seeds × {iterations:,} iterations, {one.left} to train, about "
        f"{duration(one.seconds)} on two cores"
    )
