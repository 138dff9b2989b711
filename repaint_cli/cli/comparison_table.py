"""A comparison in words: two tables and a sentence per run, for 80 columns."""

import numpy as np
from rich.table import Table

from repaint_cli.cli.console import literal
from repaint_cli.cli.printing import out
from repaint_cli.runs.comparison import Comparison, Estimate, Standing
from repaint_cli.runs.comparison_words import (
    duration,
    each_seed,
    interval,
    reduction,
    short,
    verdicts,
    whole,
)

LONGEST = 20
"""Letters of labels in a table; where one is longer, runs have numbers there."""


def print_comparison(comparison: Comparison) -> None:
    """Print who reached the target when, what everybody earned, and what the columns mean."""
    names = _names(comparison)
    if comparison.target is None:
        _print("target: unknown without a run from scratch; name one with --target")
    else:
        _print(f"[bold]{literal(comparison.task)}[/bold], target {literal(comparison.goal)}")
    if any(name != label for label, name in names.items()):
        legend = Table.grid(padding=(0, 2, 0, 0))
        for label, name in names.items():
            legend.add_row(name, literal(label))
        out.print(legend, soft_wrap=False)
    if warning := comparison.warning(names):
        _print(f"[yellow]warning:[/yellow] {literal(warning)}")
    if comparison.target is not None:
        out.print(_to_target(comparison, names), soft_wrap=False)
    out.print(_scores(comparison, names), soft_wrap=False)
    for sentence in verdicts(comparison, names):
        _print(literal(sentence))
    _print(
        "K: iteration at which the mean over seeds is at the target; K reduced: how much earlier "
        "than the reference, ×2 is twice as late; steps: a seed's until then, teachers' counted; "
        "first, final: the first evaluation, the last's interquartile mean; area: mean return "
        f"over {comparison.iterations} iterations; p: chance of such a difference in area if "
        "methods were alike; [95 % intervals over seeds]"
    )


def _print(text: str) -> None:
    """Print a text, with lines that end between words."""
    out.print(text, soft_wrap=False)


def _names(comparison: Comparison) -> dict[str, str]:
    """Return what each run is called in tables and sentences, by its label."""
    labels = [row.label for row in comparison.standings]
    if max(map(len, labels)) <= LONGEST:
        return {label: label for label in labels}
    return {label: f"run {n}" for n, label in enumerate(labels, 1)}


def _table(*heads: str) -> Table:
    return Table(*heads, box=None, pad_edge=False, padding=(0, 2, 0, 0))


def _narrow(estimate: Estimate) -> str:
    """Write a number whose interval is not broken over two lines."""
    return interval(estimate).replace(", ", ",")


def _to_target(comparison: Comparison, names: dict[str, str]) -> Table:
    table = _table("run", "K", "K reduced", "time reduced", "steps", "time", "each seed")
    for row in comparison.standings:
        table.add_row(
            literal(names[row.label]), *_arrival(comparison, row), each_seed(row.reached_each)
        )
    return table


def _arrival(comparison: Comparison, row: Standing) -> list[str]:
    """Return when a run reached the target."""
    if np.isnan(row.reached):
        return ["never", "-", "-", "-", "-"]
    alone = row.label == comparison.reference
    saved = np.nan if alone else row.seconds_reduced
    return [
        whole(row.reached),
        "-" if alone else reduction(row.reduced).replace(", ", ","),
        reduction((saved, np.nan, np.nan)),
        whole(row.env_steps),
        duration(row.seconds),
    ]


def _scores(comparison: Comparison, names: dict[str, str]) -> Table:
    table = _table("run", "seeds", "first", "area", "best", "final", "p")
    for row in comparison.standings:
        p = "-" if np.isnan(row.chance) else f"{row.chance:.2g}"
        table.add_row(
            literal(names[row.label]), str(row.seeds), short(row.first[0]), _narrow(row.area),
            short(row.best), _narrow(row.final), p,
        )  # fmt: skip
    return table
