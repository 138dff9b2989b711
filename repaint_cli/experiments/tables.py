"""Tables of an experiment: our numbers with intervals, and the paper's in brackets behind them."""

from collections.abc import Iterable, Iterator
from math import isnan

from repaint_cli.experiments.measures import MeasuredRow
from repaint_cli.experiments.schema import NEVER
from repaint_cli.runs.comparison_words import duration, interval, reduction, short, whole

HEADS = (
    "panel", "variant", "seeds", "K (paper)", "reduced (paper)", "best (paper)", "area [95 %]",
    "steps at K", "time at K (paper)",
)  # fmt: skip

MEANING = (
    "K: the first iteration at which the mean over seeds is at the target; reduced: 1 - K / K from "
    "scratch, x2 is twice as late; area: mean return over all iterations; steps: a seed's until "
    "K, teachers' counted; in round brackets the paper's number, in square brackets the 95 % "
    "interval over seeds."
)


def markdown(rows: Iterable[MeasuredRow]) -> Iterator[str]:
    """Yield the lines of a table."""
    yield f"| {' | '.join(HEADS)} |"
    yield "|---|---|" + "---:|" * (len(HEADS) - 2)
    for row in rows:
        yield f"| {' | '.join(cells(row))} |"


def cells(row: MeasuredRow) -> list[str]:
    """Return the cells of a row."""
    ours, name = row.ours, row.variant
    paper = row.paper
    k = "never" if isnan(ours.reached) else f"{ours.reached:.0f}"
    reduced = reduction(ours.reduced) if row.compared else ""
    best = short(ours.best)
    time = duration(ours.seconds)
    if paper:
        k += _behind(paper.k.get(name), "")
        share = paper.reduced(name)
        reduced += "" if share is None else f" ({share:.0%})"
        best += _behind(paper.target if name == "scratch" else paper.best.get(name), "")
        time += _behind(paper.hours.get(name), " h")
    return [
        row.panel, name, str(ours.seeds), k, reduced, best, interval(ours.area),
        whole(ours.env_steps), time,
    ]  # fmt: skip


def _behind(number: object, unit: str) -> str:
    """Write a number of the paper in brackets, if there is one."""
    if number is None:
        return ""
    return " (never)" if number == NEVER else f" ({number:g}{unit})"


def nobody_reached(rows: Iterable[MeasuredRow]) -> list[str]:
    """Say of which panels nobody reached the target."""
    panels: dict[str, list[MeasuredRow]] = {}
    for row in rows:
        panels.setdefault(row.panel, []).append(row)
    return [
        f"{title}: nobody reached the target {own[0].target:.4g} in {own[0].ours.iterations} "
        f"iterations; the best mean is {max(row.ours.best for row in own):.4g}"
        for title, own in panels.items()
        if own[0].target is not None and all(isnan(row.ours.reached) for row in own)
    ]
