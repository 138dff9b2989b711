"""A comparison in words: two tables and a sentence per run, for 80 columns."""

import numpy as np
from rich.table import Table

from repaint_cli.cli.console import literal
from repaint_cli.cli.screen import out
from repaint_cli.runs.comparison import Comparison
from repaint_cli.runs.comparison_words import duration, interval, percent, short, verdicts


def print_comparison(comparison: Comparison) -> None:
    """Print who reached the target when, what everybody earned, and what the columns mean."""
    if comparison.target is None:
        out.print("target: unknown without a run from scratch; name one with --target")
    else:
        out.print(f"[bold]{literal(comparison.task)}[/bold], target {literal(comparison.goal)}")
        out.print(_to_target(comparison))
    out.print(_scores(comparison))
    for sentence in verdicts(comparison):
        out.print(literal(sentence))
    out.print(
        "K: iteration at which the mean over seeds is at the target; steps: a seed's until then, "
        "teachers' counted; first, final: the first evaluation, the last's interquartile mean; "
        f"area: mean return over {comparison.iterations} iterations; p: chance of such a "
        "difference in area if methods were alike; [95 % intervals over seeds]"
    )


def _to_target(comparison: Comparison) -> Table:
    table = Table("run", "K", "K reduced", "time reduced", "steps", "time", "each seed", box=None)
    for row in comparison.standings:
        if np.isnan(row.reached):
            cells = ["not achieved", "", "", "", ""]
        else:
            reference = row.label == comparison.reference
            cells = [
                f"{row.reached:.0f}",
                "-" if reference else percent(row.reduced),
                "-" if reference or np.isnan(row.seconds_reduced) else f"{row.seconds_reduced:.0%}",
                f"{row.env_steps:,.0f}",
                duration(row.seconds),
            ]
        each = ["never" if np.isnan(k) else f"{k:.0f}" for k in row.reached_each]
        table.add_row(literal(row.label), *cells, ", ".join(each))
    return table


def _scores(comparison: Comparison) -> Table:
    table = Table("run", "seeds", "first", "area", "best", "final", "p", box=None)
    for row in comparison.standings:
        p = "-" if np.isnan(row.chance) else f"{row.chance:.2g}"
        table.add_row(
            literal(row.label), str(row.seeds), short(row.first[0]), interval(row.area),
            short(row.best), interval(row.final), p,
        )  # fmt: skip
    return table
