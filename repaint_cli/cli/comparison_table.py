"""A comparison in words: what was earned, who is ahead, who arrived when; for 80 columns."""

from typing import TYPE_CHECKING

import numpy as np
from rich.table import Table

from repaint_cli.cli.console import literal
from repaint_cli.cli.printing import out
from repaint_cli.report.statistics import Estimate, trims
from repaint_cli.runs.comparison import Comparison
from repaint_cli.runs.comparison_words import (
    chance,
    duration,
    interval,
    needed,
    paper_alike,
    ran_away,
    reduction,
    seeds_can_show,
    seeds_k,
    short,
    target_name,
    unreached,
    verdicts,
    whole,
)
from repaint_cli.runs.standings import Standing

if TYPE_CHECKING:
    from repaint_cli.runs.against_itself import AgainstItself

LONGEST = 13
"""Letters of labels in a table; where one is longer, runs have numbers there."""


def print_comparison(comparison: Comparison) -> None:
    """Print what everybody earned, who is ahead, who reached the targets when, in four tables."""
    names = _names(comparison)
    _print_head(comparison, names)
    head = f"mean return; area over {comparison.iterations} iterations"
    _print_table(head, _scores(comparison, names))
    if any(row.against for row in comparison.standings):
        basis = literal(names[str(comparison.reference)])
        _print_table(f"difference in area from {basis}", _differences(comparison, names))
    if comparison.standings[0].targets:
        head = "iterations that a seed needed to a return of"
        if not comparison.given:
            basis = literal(names[str(comparison.reference)])
            head = f"iterations that a seed needed to shares of what {basis} converged to"
        _print_table(head, _targets(comparison, names))
    if comparison.target is not None:
        head = f"the paper's measure: the mean curve first at {literal(comparison.goal)}"
        _print_table(head, _paper(comparison, names))
    _print("")
    for sentence in _sentences(comparison, names):
        _print(literal(sentence))
    _print("")
    _print_meanings(comparison)


def _print_head(comparison: Comparison, names: dict[str, str]) -> None:
    task = f"[bold]{literal(comparison.task)}[/bold]"
    if comparison.reference is None:
        _print(f"{task}, without a run from scratch to compare with; name one with --reference")
    else:
        _print(f"{task}, compared with {literal(comparison.reference)}")
    if any(name != label for label, name in names.items()):
        legend = Table.grid(padding=(0, 2, 0, 0))
        for label, name in names.items():
            legend.add_row(name, literal(label))
        out.print(legend, soft_wrap=False)
    if warning := comparison.warning(names):
        _print(f"[yellow]warning:[/yellow] {literal(warning)}")


def _print_table(head: str, table: Table) -> None:
    _print(f"\n[italic]{head}[/italic]")
    out.print(table, soft_wrap=False)


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


def _scores(comparison: Comparison, names: dict[str, str]) -> Table:
    table = _table("run", "seeds", "first", "final", "area", "by steps")
    for row in comparison.standings:
        table.add_row(
            literal(names[row.label]), str(row.seeds), short(row.first[0]), short(row.final[0]),
            _narrow(row.area), short(row.area_by_steps[0]),
        )  # fmt: skip
    return table


def _differences(comparison: Comparison, names: dict[str, str]) -> Table:
    table = _table("run", "difference", "p", "P(better)", "seeds needed")
    for row in comparison.standings:
        if row.against:
            area = row.against.area
            table.add_row(
                literal(names[row.label]), _narrow(area.mean), chance(area.p),
                _narrow(row.against.better), needed(area.seeds_needed),
            )  # fmt: skip
    return table


def _targets(comparison: Comparison, names: dict[str, str]) -> Table:
    first, *_ = comparison.standings
    table = _table("run", *(target_name(one).replace(": ", "\n") for one in first.targets))
    for row in comparison.standings:
        table.add_row(literal(names[row.label]), *map(seeds_k, row.targets))
    return table


def _paper(comparison: Comparison, names: dict[str, str]) -> Table:
    table = _table("run", "K", "reduced", "steps", "time", "time reduced")
    for row in comparison.standings:
        table.add_row(literal(names[row.label]), *_arrival(row))
    return table


def _arrival(row: Standing) -> list[str]:
    """Return when a run's mean reached the target."""
    if np.isnan(row.reached):
        return ["never", "-", "-", "-", "-"]
    return [
        whole(row.reached), reduction(row.reduced), whole(row.env_steps), duration(row.seconds),
        reduction(row.seconds_reduced),
    ]  # fmt: skip


def _sentences(comparison: Comparison, names: dict[str, str]) -> list[str]:
    """Return who is ahead, and what the seeds can show."""
    several = len(comparison.standings) > 1
    alike = paper_alike(comparison, names) if several else None
    return [
        *verdicts(comparison, names),
        *ran_away(comparison, names),
        *unreached(comparison),
        *seeds_can_show(comparison, names),
        *([f"by the paper's measure {alike}"] if alike else []),
    ]


def _print_meanings(comparison: Comparison) -> None:
    """Print what the columns are, a line each."""
    several = any(row.against for row in comparison.standings)
    trimmed = any(trims(row.seeds) for row in comparison.standings)
    final = "interquartile mean" if trimmed else "mean"
    meanings = {
        "first, final": f"the first evaluation, and the last's {final}",
        "area": "mean return over iterations; by steps: over steps that all have",
    }
    if several:
        meanings |= {
            "p": "chance of such a difference if the methods were alike",
            "P(better)": "chance that a seed earns more than one of the reference",
            "seeds needed": "so many seeds would show such a difference (80 % power)",
        }
    if any(0 < one.arrived < row.seeds for row in comparison.standings for one in row.targets):
        meanings["9/10"] = f"9 of 10 seeds arrived; the others count as {comparison.iterations}"
    if comparison.target is not None:
        meanings["K, steps, time"] = "until the mean over seeds was there, teachers' steps counted"
        if several:
            meanings["reduced"] = "how much earlier than the reference; ×2 is twice as late"
    meanings["[low,high]"] = "95 % interval over seeds"
    grid = Table.grid(padding=(0, 2, 0, 0))
    for name, meaning in meanings.items():
        grid.add_row(literal(name), meaning)
    out.print(grid, soft_wrap=False)


def print_against_itself(alike: "AgainstItself") -> None:
    """Print what each number is where there is no difference."""
    from repaint_cli.runs.against_itself import title_of
    from repaint_cli.runs.against_itself_report import HEADS, false_alarms_of, rows_of

    _print(f"[bold]{literal(title_of(alike))}[/bold]")
    table = _table(*HEADS)
    for cells in rows_of(alike):
        table.add_row(*map(literal, cells))
    out.print(table, soft_wrap=False)
    _print(false_alarms_of(alike))
    _print(
        "each number compares two groups of seeds of one method, split at random; what a "
        "comparison of two methods shows must lie outside to mean anything"
    )
