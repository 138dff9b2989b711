"""A comparison's numbers in words, for a terminal and for a page."""

import numpy as np

from repaint_cli.runs.comparison import Comparison, Estimate, Standing


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


def percent(estimate: Estimate) -> str:
    """Write a share with its interval, if it has one."""
    mean, low, high = estimate
    if np.isnan(mean):
        return "-"
    return f"{mean:.0%}" + ("" if np.isnan(low) else f" [{low:.0%}, {high:.0%}]")


def whole(number: float) -> str:
    """Write a number without a point: 12,300."""
    return "-" if np.isnan(number) else f"{number:,.0f}"


def duration(seconds: float) -> str:
    """Write a time: 42 s, 3.1 min, 2.5 h."""
    if np.isnan(seconds):
        return "-"
    if seconds < 60:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.1f} min" if seconds < 3600 else f"{seconds / 3600:.1f} h"
