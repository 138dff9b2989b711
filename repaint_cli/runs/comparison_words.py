"""A comparison's numbers in words, for a terminal and for a page."""

from collections.abc import Mapping
from math import isinf, isnan
from typing import TYPE_CHECKING

from repaint_cli.report.coverage import coverage_of

if TYPE_CHECKING:
    from repaint_cli.report.pairs import Difference
    from repaint_cli.report.statistics import Estimate
    from repaint_cli.runs.comparison import Comparison
    from repaint_cli.runs.standings import Against, SeedArrivals

LEVEL = 0.05
"""p at which a difference counts as shown."""


def verdicts(comparison: "Comparison", names: Mapping[str, str] | None = None) -> list[str]:
    """Say in a sentence per run whether its area is ahead of the reference's, or not.

    Args:
        comparison: of runs.
        names: what to call runs, by their labels; those where absent.
    """
    called = names or {row.label: row.label for row in comparison.standings}
    other = called.get(str(comparison.reference), "")
    return [
        f"{called[row.label]} {_verdict(row.against, other)}"
        for row in comparison.standings
        if row.against
    ]


def _verdict(against: "Against", other: str) -> str:
    area = against.area
    gap, low, high = area.mean
    if isnan(gap):
        return f"and {other} have no areas to compare"
    if gap == low == high == 0:
        return f"earned exactly what {other} did"
    size, ahead = f"{abs(gap):.3g}", gap > 0
    if isnan(low):
        return f"earned {size} {'more' if ahead else 'less'} than {other}; one seed shows no spread"
    if low > 0 or high < 0:
        certain = "is" if area.p <= LEVEL else "is probably"
        place = "ahead of" if ahead else "behind"
        more = "higher" if ahead else "lower"
        return f"{certain} {place} {other}: its mean return is {size} {more}"
    return f"cannot be told apart from {other}{_needed(area.seeds_needed)}"


def _needed(seeds: float) -> str:
    if isnan(seeds):
        return ""
    number = "endless" if isinf(seeds) else f"about {seeds:,.0f}"
    return f"; {number} seeds would show such a difference"


def seeds_can_show(comparison: "Comparison", names: Mapping[str, str] | None = None) -> list[str]:
    """Say what the seeds of a comparison can show: of each kind of pair of runs, a sentence."""
    basis, sentences = comparison.basis, list[str]()
    called = names or {row.label: row.label for row in comparison.standings}
    for row in comparison.standings:
        if basis and row.against and not isnan(row.against.area.mean[1]):
            area, both = row.against.area, f"{called[row.label]} and {called[basis.label]}"
            if area.pairs == 0:
                some = f"seeds of {both} that are not the same, in no pairs"
            elif area.pairs == row.seeds == basis.seeds:
                some = f"{area.pairs} seeds"
            else:
                most = max(row.seeds, basis.seeds)
                some = f"{area.pairs} seeds that {both} share, of {most}"
            sentences.append(f"{some}: {_can_show(area, min(row.seeds, basis.seeds))}")
    return list(dict.fromkeys(sentences))


def _can_show(area: "Difference", seeds: int) -> str:
    coverage = coverage_of(area.pairs or seeds, paired=area.pairs > 0)
    few = "" if area.smallest_p <= LEVEL else ", so it decides nothing alone"
    return (
        f"p cannot be below {area.smallest_p:.2g}{few}; 95 % intervals of differences hold the "
        f"truth in {coverage.normal:.0f} % of cases, in {coverage.skewed:.0f} % where returns have "
        "a long tail"
    )


def paper_alike(comparison: "Comparison", names: Mapping[str, str] | None = None) -> str | None:
    """Say what the paper's measure gives for two runs of the reference's method, or None."""
    alike, label = comparison.no_difference, str(comparison.reference)
    if alike is None or alike.never == 1:
        return None
    _, low, high = alike.reduced
    return (
        f"two runs like {(names or {}).get(label, label)}, with {alike.seeds} seeds each, give "
        f"“never” in {alike.never:.0%} of cases, else K {_earlier(low)} to {_earlier(high)}"
    )


def _earlier(reduced: float) -> str:
    """Write a reduction of K as it is said."""
    return f"{reduced:.0%} earlier" if reduced >= 0 else f"{-reduced:.0%} later"


def ran_away(comparison: "Comparison", names: Mapping[str, str] | None = None) -> list[str]:
    """Say of each seed that lies far from the others that its run's means hold it all the same."""
    called = names or {row.label: row.label for row in comparison.standings}
    return [
        f"seed {seed} of {called[row.label]} ran away from the others: its area is {short(area)}, "
        f"the median's {short(middle)}; the means count it in full"
        for row in comparison.standings
        for seed, area, middle in row.runaways
    ]


def unreached(comparison: "Comparison") -> list[str]:
    """Say of each target that no seed of any run reached."""
    return [
        f"no seed of any run reached {arrivals.target:.4g} within {comparison.iterations} "
        "iterations"
        for i, arrivals in enumerate(comparison.standings[0].targets)
        if not any(row.targets[i].arrived for row in comparison.standings)
    ]


def short(number: float) -> str:
    """Write a number for a narrow column."""
    return "-" if isnan(number) else f"{number:.4g}"


def interval(estimate: "Estimate") -> str:
    """Write a number with its interval, if it has one."""
    mean, low, high = estimate
    return short(mean) + ("" if isnan(low) else f" [{low:.3g}, {high:.3g}]")


def reduction(number: float) -> str:
    """Write a reduction, 1 − K / K of the reference.

    A later K is no percentage: ×3 is three times as late.
    """
    if isnan(number):
        return "-"
    return f"{number:.0%}" if number > -0.005 else f"×{1 - number:.3g}"


def chance(p: float) -> str:
    """Write a p."""
    return "-" if isnan(p) else f"{p:.2g}"


def needed(seeds: float) -> str:
    """Write how many seeds a difference would need."""
    if isnan(seeds):
        return "-"
    return "endless" if isinf(seeds) else f"{seeds:,.0f}"


def seeds_k(arrivals: "SeedArrivals") -> str:
    """Write when seeds reached a target: their restricted mean, and how many did if not all."""
    n = len(arrivals.reached_each)
    if arrivals.arrived == 0:
        return "never"
    some = "" if arrivals.arrived == n else f" {arrivals.arrived}/{n}"
    return f"{arrivals.k[0]:.3g}{some}"


def target_name(arrivals: "SeedArrivals") -> str:
    """Write a target, and which share of the reference's converged score it is."""
    share = "" if arrivals.share is None else f"{arrivals.share:.0%}: "
    return f"{share}{arrivals.target:.4g}"


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
