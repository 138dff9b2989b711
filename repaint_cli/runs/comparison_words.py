"""A comparison's numbers in words, for a terminal and for a page."""

from collections.abc import Mapping, Sequence
from math import isnan
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from repaint_cli.runs.comparison import Comparison, Estimate, Standing

FEW = 3
"""Seeds whose numbers are written one by one."""


def verdicts(comparison: "Comparison", names: Mapping[str, str] | None = None) -> list[str]:
    """Say in a sentence per run whether its area is ahead of the reference's, or not.

    Args:
        comparison: of runs.
        names: what to call runs, by their labels; those where absent.
    """
    basis = next((row for row in comparison.standings if row.label == comparison.reference), None)
    called = names or {row.label: row.label for row in comparison.standings}
    others = [row for row in comparison.standings if basis and row is not basis]
    return [_verdict(row, basis, called) for row in others if basis]


def _verdict(row: "Standing", basis: "Standing", called: Mapping[str, str]) -> str:
    ahead = row.area[0] - basis.area[0]
    name, other = called[row.label], called[basis.label]
    if ahead == 0:
        return f"{name} earned exactly what {other} did"
    word = "above" if ahead > 0 else "below"
    sure = "" if isnan(row.chance) else f", p = {row.chance:.2g}"
    return (
        f"{name} earned {abs(ahead):.3g} {word} {other} per iteration "
        f"(mean return {row.area[0]:.4g} against {basis.area[0]:.4g}{sure})"
    )


def short(number: float) -> str:
    """Write a number for a narrow column."""
    return "-" if isnan(number) else f"{number:.4g}"


def interval(estimate: "Estimate") -> str:
    """Write a number with its interval, if it has one."""
    mean, low, high = estimate
    return short(mean) + ("" if isnan(low) else f" [{low:.3g}, {high:.3g}]")


def reduction(estimate: "Estimate") -> str:
    """Write a reduction, 1 − K / K of the reference, with its interval, if it has one.

    A later K is no percentage: ×3 is three times as late.
    """
    mean, low, high = estimate
    if isnan(mean):
        return "-"
    return _reduced(mean) + ("" if isnan(low) else f" [{_reduced(low)}, {_reduced(high)}]")


def _reduced(number: float) -> str:
    return f"{number:.0%}" if number > -0.005 else f"×{1 - number:.3g}"


def each_seed(reached: Sequence[float]) -> str:
    """Write each seed's K; of many the least and the largest, and how many never get there."""
    known = sorted(k for k in reached if not isnan(k))
    if len(reached) <= FEW:
        return ", ".join("never" if isnan(k) else f"{k:.0f}" for k in reached)
    never = len(reached) - len(known)
    parts = [f"{known[0]:.0f}-{known[-1]:.0f}"] if known else []
    return ", ".join([*parts, f"{never} never"] if never else parts)


def whole(number: float) -> str:
    """Write a number without a point: 12,300."""
    return "-" if isnan(number) else f"{number:,.0f}"


def duration(seconds: float) -> str:
    """Write a time: 2.4 s, 42 s, 3.1 min, 42 min, 2.5 h."""
    if isnan(seconds):
        return "-"
    if seconds < 99.5:
        return f"{seconds:.1f} s" if seconds < 9.95 else f"{seconds:.0f} s"
    minutes = seconds / 60
    if minutes < 99.5:
        return f"{minutes:.1f} min" if minutes < 9.95 else f"{minutes:.0f} min"
    return f"{minutes / 60:.1f} h"
