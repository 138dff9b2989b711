"""How often the 95 % intervals of `repaint compare` hold the truth, by simulation; a minute.

    python benchmarks/interval_coverage.py

Prints the table in docs/comparing.md and writes benchmarks/results/coverage.csv. Normal seeds are
what few numbers are usually taken for; skewed ones are log-normal, with a tail of lucky seeds.
"""

import csv
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from scipy import stats

from repaint_cli.report.arrivals import restricted
from repaint_cli.report.pairs import better, welch
from repaint_cli.report.statistics import interquartile_mean_of, mean_ci, t_interval

RESULT = Path(__file__).parent / "results" / "coverage.csv"
SEEDS = (2, 3, 4, 5, 7, 10, 20)
REPETITIONS = 2_000
QUICK_REPETITIONS = 40_000
"""Of intervals that are computed for all repetitions at once."""
HORIZON = 20
"""Iterations after which arrivals are censored."""

Draw = Callable[[np.random.Generator, tuple[int, ...]], np.ndarray]


def normal(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Draw normal numbers."""
    return rng.normal(0, 1, shape)


def skewed(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Draw log-normal numbers."""
    return rng.lognormal(0, 1, shape)


def arrivals(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Draw iterations at which a seed arrives, censored at the horizon: min(K, H)."""
    reached = np.ceil(rng.lognormal(2.3, 0.7, shape))
    reached[reached > HORIZON] = np.nan
    return restricted(reached, HORIZON)


LAWS: dict[str, Draw] = {"normal": normal, "skewed": skewed}
MANY = 4_000_000
"""Numbers that a truth without a formula is the mean of."""


def truth(name: str, draw: Draw) -> float:
    """Return what an interval is to hold, where one run follows `draw` and the other is normal."""
    rng = np.random.default_rng(1)
    own = draw(rng, (MANY,))
    if name == "P(X > Y)":
        return float((own > normal(rng, (MANY,))).mean())
    if name == "interquartile mean":
        return float(stats.trim_mean(own, 0.25))
    return float(own.mean())


def held(name: str, draw: Draw, n: int, value: float) -> float:
    """Return in which share of the repetitions the interval of n seeds holds the value."""
    rng = np.random.default_rng(n)
    if name in ("difference of pairs", "mean", "K, restricted mean"):
        own = draw(rng, (n, QUICK_REPETITIONS))
        if name == "difference of pairs":
            own = own - normal(rng, own.shape)
        _, low, high = t_interval(own)
        return float(((low <= value) & (value <= high)).mean())
    inside = 0
    for _ in range(REPETITIONS):
        own, basis = draw(rng, (n,)), normal(rng, (n,))
        _, low, high = {
            "difference of groups": lambda own, basis: welch(own, basis),
            "P(X > Y)": lambda own, basis: better(own, basis),
            "interquartile mean": lambda own, _: interquartile_mean_of(own),
            "mean, by bootstrap": lambda own, _: mean_ci(own),
        }[name](own, basis)
        inside += low <= value <= high
    return inside / REPETITIONS


INTERVALS = {
    "difference of pairs": LAWS, "difference of groups": LAWS, "P(X > Y)": LAWS, "mean": LAWS,
    "interquartile mean": LAWS, "K, restricted mean": {"censored": arrivals},
    "mean, by bootstrap": LAWS,
}  # fmt: skip


def rows() -> Iterator[dict[str, object]]:
    """Yield a row per interval, law and number of seeds."""
    for name, laws in INTERVALS.items():
        for law, draw in laws.items():
            value = truth(name, draw)
            for n in SEEDS:
                share = held(name, draw, n, value)
                yield {"interval": name, "law": law, "seeds": n, "coverage": f"{share:.3f}"}


def markdown(table: list[dict[str, str]]) -> Iterator[str]:
    """Yield the table's lines for people: per cent, by the number of seeds."""
    yield f"| interval | seeds' numbers | {' | '.join(f'n = {n}' for n in SEEDS)} |"
    yield "|---" * (len(SEEDS) + 2) + "|"
    for name, laws in INTERVALS.items():
        for law in laws:
            own = [row for row in table if (row["interval"], row["law"]) == (name, law)]
            cells = " | ".join(f"{100 * float(row['coverage']):.0f}" for row in own)
            yield f"| {name} | {law} | {cells} |"


def kept() -> list[dict[str, str]]:
    """Return the rows that were written."""
    with RESULT.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def main() -> None:
    """Simulate, write, and print."""
    with RESULT.open("w", encoding="utf-8") as file:
        writer = csv.DictWriter(file, ("interval", "law", "seeds", "coverage"), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows())
    print("\n".join(markdown(kept())))


if __name__ == "__main__":
    main()
