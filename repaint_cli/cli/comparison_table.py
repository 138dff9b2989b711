"""A comparison in words: two tables and a sentence per run, for 80 columns."""

import numpy as np
from rich.table import Table

from repaint_cli.cli.console import literal
from repaint_cli.cli.screen import out
from repaint_cli.runs.comparison import Comparison, Estimate, Standing


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
                "-" if reference else _percent(row.reduced),
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


def verdicts(comparison: Comparison) -> list[str]:
    """Say in a sentence per run whether its area is ahead of the reference's, or not."""
    basis = next((row for row in comparison.standings if row.label == comparison.reference), None)
    return [_verdict(row, basis) for row in comparison.standings if basis and row is not basis]


def _verdict(row: Standing, basis: Standing) -> str:
    ahead = row.area[0] - basis.area[0]
    if ahead == 0:
        return f"{row.label} earned exactly what {basis.label} did"
    word = "above" if ahead > 0 else "below"
    sure = "" if np.isnan(row.chance) else f", p = {row.chance:.2g}"
    return (
        f"{row.label} earned {abs(ahead):.3g} {word} {basis.label} per iteration "
        f"(mean return {row.area[0]:.4g} against {basis.area[0]:.4g}{sure})"
    )


def short(number: float) -> str:
    """Write a number for a narrow column."""
    return "-" if np.isnan(number) else f"{number:.4g}"


def interval(estimate: Estimate) -> str:
    """Write a number with its interval, if it has one."""
    mean, low, high = estimate
    return short(mean) + ("" if np.isnan(low) else f" [{low:.3g}, {high:.3g}]")


def _percent(estimate: Estimate) -> str:
    mean, low, high = estimate
    if np.isnan(mean):
        return "-"
    return f"{mean:.0%}" + ("" if np.isnan(low) else f" [{low:.0%}, {high:.0%}]")


def duration(seconds: float) -> str:
    """Write a time: 42 s, 3.1 min, 2.5 h."""
    if seconds < 60:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.1f} min" if seconds < 3600 else f"{seconds / 3600:.1f} h"
