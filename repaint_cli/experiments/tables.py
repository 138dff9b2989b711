"""Tables of an experiment: our numbers with intervals, and the paper's in brackets behind them."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import isnan

from repaint_cli.experiments.measures import MeasuredRow
from repaint_cli.experiments.schema import NEVER
from repaint_cli.runs.aggregate import Aggregated
from repaint_cli.runs.comparison_words import duration, interval, reduction, short, whole

HEADS: Sequence[str] = (
    "panel", "variant", "seeds", "K (paper)", "reduced (paper)", "best (paper)", "area [95 %]",
    "steps at K", "time at K (paper)",
)  # fmt: skip

MEANING = (
    "K: the first iteration at which the mean over seeds is at the target; reduced: 1 − K / K from "
    "scratch, ×2 is twice as late; best: highest mean; area: mean return over all iterations; in "
    "round brackets the paper's number, in square brackets the 95 % interval over seeds"
)
MORE = (
    "steps at K: a seed's until then, teachers' counted; time at K: of all seeds together until "
    "then, evaluations counted"
)
"""What the columns mean of which a terminal has no room for all."""


def markdown(rows: Sequence[MeasuredRow], kind: str = "rows") -> Iterator[str]:
    """Yield the lines of a table; `kind` is as in `Experiment.table`."""
    heads, body = heads_of(rows), [cells(row) for row in rows]
    if kind != "rows":
        heads, body = summary(rows, time=kind == "time")
    yield f"| {' | '.join(heads)} |"
    yield "|---|---|" + "---:|" * (len(heads) - 2)
    for line in body:
        yield f"| {' | '.join(line)} |"


def heads_of(rows: Iterable[MeasuredRow]) -> Sequence[str]:
    """Return the heads of the columns of rows, which name the paper where it has numbers."""
    return _named(HEADS, rows)


def _named(heads: Sequence[str], rows: Iterable[MeasuredRow]) -> Sequence[str]:
    if any(row.paper for row in rows):
        return heads
    return [head.removesuffix(" (paper)") for head in heads]


OVER_HEADS: Sequence[str] = ("over all panels", "panels", "IQM", "mean", "gap to 1", "P(better)")
OVER_MEANING = (
    "over all panels: areas as shares of the way that training from scratch went (0 its first "
    "evaluation, 1 where it converged); IQM: mean of the middle half of all seeds; gap to 1: by "
    "how much seeds fall short of 1; P(better): chance that a seed earns more than one from "
    "scratch; in brackets a bootstrap within each panel, too narrow with few seeds"
)
"""What the columns mean."""


def over_cells(variant: str, over: Aggregated) -> list[str]:
    """Return the cells of a variant's numbers over all panels."""
    numbers = [over.numbers[name] for name in ("iqm", "mean", "optimality_gap")]
    return [
        variant, str(len(over.pairs)), *map(interval, numbers), interval(over.improvement)
    ]  # fmt: skip


def over_markdown(over: Mapping[str, Aggregated]) -> Iterator[str]:
    """Yield the lines of the table of numbers over all panels, none where there are none."""
    if over:
        yield f"| {' | '.join(OVER_HEADS)} |"
        yield "|---|" + "---:|" * (len(OVER_HEADS) - 1)
        for variant, numbers in over.items():
            yield f"| {' | '.join(over_cells(variant, numbers))} |"
        yield f"\n{OVER_MEANING}."


def summary(rows: Sequence[MeasuredRow], *, time: bool) -> tuple[Sequence[str], list[list[str]]]:
    """Return heads and lines, a line a panel: its target, and K or the time of each variant."""
    panels: dict[tuple[str, str], dict[str, MeasuredRow]] = {}
    for row in rows:
        panels.setdefault((row.experiment, row.panel), {})[row.variant] = row
    variants = list(dict.fromkeys(name for own in panels.values() for name in own))
    lines = []
    for (experiment, title), own in panels.items():
        first = next(iter(own.values()))
        target = "-" if first.target is None else f"{first.target:.4g}"
        target += f" ({first.paper.target:g})" if first.paper else ""
        arrivals = [_arrival(own[name], time) if name in own else "" for name in variants]
        lines.append([f"{experiment}: {title}", target, *arrivals])
    what = "time" if time else "K"
    heads = ("panel", "target (paper)", *(f"{what} {name} (paper)" for name in variants))
    return _named(heads, rows), lines


def _arrival(row: MeasuredRow, time: bool) -> str:
    """Write when a variant was at the target, and how much sooner than scratch."""
    ours, paper = row.ours, row.paper
    if row.target is None:
        text = "-"
    elif isnan(ours.reached):
        text = "never"
    else:
        text = duration(ours.seconds) if time else f"{ours.reached:.0f}"
        saved = ours.seconds_reduced if time else ours.reduced
        text += f", {reduction(saved)}" if row.compared and not isnan(saved) else ""
    if paper is None:
        return text
    text += _behind((paper.hours if time else paper.k).get(row.variant), " h" if time else "")
    share = paper.reduced(row.variant, hours=time)
    return text if share is None else f"{text[:-1]}, {share:.0%})"


def cells(row: MeasuredRow) -> list[str]:
    """Return the cells of a row."""
    ours, name = row.ours, row.variant
    paper = row.paper
    k = "never" if isnan(ours.reached) else f"{ours.reached:.0f}"
    k = "-" if row.target is None else k
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
    panels: dict[tuple[str, str], list[MeasuredRow]] = {}
    for row in rows:
        panels.setdefault((row.experiment, row.panel), []).append(row)
    return [
        f"{title}: nobody reached the target {own[0].target:.4g} in {own[0].ours.iterations} "
        f"iterations; the best mean is {max(row.ours.best for row in own):.4g}"
        for (_, title), own in panels.items()
        if own[0].target is not None and all(isnan(row.ours.reached) for row in own)
    ]
