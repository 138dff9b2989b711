"""How often our 95 % intervals hold the truth, by the number of seeds, as it was simulated.

The numbers are those of benchmarks/results/coverage.csv, simulated by
benchmarks/interval_coverage.py.
"""

from typing import NamedTuple


class Coverage(NamedTuple):
    """Of the interval of a difference between two runs."""

    normal: float
    """In per cent, where both runs' numbers are normal."""
    skewed: float
    """Where one run's are log-normal, with a long tail, and the other's are not."""


PAIRS = {
    2: Coverage(95, 94), 3: Coverage(95, 94), 4: Coverage(95, 93), 5: Coverage(95, 92),
    7: Coverage(95, 91), 10: Coverage(95, 91), 20: Coverage(95, 91),
}  # fmt: skip
"""Of differences seed by seed, by the number of seeds."""

GROUPS = {
    2: Coverage(98, 96), 3: Coverage(96, 94), 4: Coverage(96, 92), 5: Coverage(96, 93),
    7: Coverage(96, 92), 10: Coverage(95, 91), 20: Coverage(96, 92),
}  # fmt: skip
"""Of differences of the means of as many other seeds."""


def coverage_of(n_seeds: int, *, paired: bool = True) -> Coverage:
    """Return what intervals of so many seeds cover: that of the next smaller number simulated."""
    table = PAIRS if paired else GROUPS
    return table[max(n for n in table if n <= n_seeds)]
