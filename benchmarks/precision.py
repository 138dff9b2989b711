"""Learning in bf16 beside learning in float32: the same seeds, from scratch on racer-outer.

    python benchmarks/precision.py                   # the table of what was measured
    python benchmarks/precision.py --measure small   # measures one network: small, card

A seed begins with the same weights in every row and is evaluated in the same episodes; a row's
difference is the mean over seeds of its area less float32's, with a 95 % t interval. What
rounding alone does is shown twice. "Other sums" is float32 again with the instructions of an older
CPU (MKL_ENABLE_INSTRUCTIONS=AVX2), which adds the products of dense layers in another order.
"Halves" is how far the means of two halves of float32's own seeds lie apart: in 95 of 100 splits
no further.

Each row is one `repaint transfer` in a process of its own with one thread, two at a time. The runs
go to runs/precision/, the areas to benchmarks/results/, a line per row and seed.
"""

import argparse
import csv
import os
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np
from rich.console import Console
from scipy.stats import ttest_1samp
from turns import Table, drawn

from repaint_cli.report.statistics import area_under_curve
from repaint_cli.runs.reader import read_run

RESULTS = Path(__file__).parent / "results" / "precision.csv"
COLUMNS = ("network", "row", "seed", "area", "last_return")


@dataclass(frozen=True)
class Network:
    """A network, and how much of it is measured."""

    n_seeds: int
    """From 100 on: seeds for choosing."""
    n_iterations: int
    settings: tuple[str, ...] = ()


NETWORKS = {
    "small": Network(10, 8, ("net.conv=[[16,8,4],[32,4,2]]", "net.dense=128", "net.pool=4")),
    "card": Network(3, 7),
}
ROWS: dict[str, tuple[str, dict[str, str]]] = {
    "float32": ("float32", {}),
    "float32, other sums": ("float32", {"MKL_ENABLE_INSTRUCTIONS": "AVX2"}),
    "bf16": ("bf16", {}),
}
"""By name: the precision, and variables of the process."""


def train(network: str, row: str) -> list[dict[str, str]]:
    """Train all seeds of a row, unless that is done; return a line per seed."""
    numbers, (precision, variables) = NETWORKS[network], ROWS[row]
    folder = Path("runs") / "precision" / network / row.replace(", ", "-").replace(" ", "-")
    settings = [f"net.precision={precision}", *numbers.settings]
    begin = [
        "--task", "racer-outer", "--method", "scratch", "--seed", "100",
        "--seeds", str(numbers.n_seeds), "--run", str(folder),
        *(word for setting in settings for word in ("--set", setting)),
    ]  # fmt: skip
    chosen = ["--resume", str(folder)] if folder.exists() else begin
    command = ["transfer", *chosen, "--iterations", str(numbers.n_iterations)]
    subprocess.run(
        [sys.executable, "-m", "repaint_cli", *command], check=True, stdout=subprocess.DEVNULL,
        env=os.environ | {"OMP_NUM_THREADS": "1"} | variables,
    )  # fmt: skip
    run = read_run(folder)
    areas, last = area_under_curve(run.returns), run.returns[:, -1]
    return [
        dict(zip(COLUMNS, (network, row, str(seed), f"{a:.5g}", f"{r:.5g}"), strict=True))
        for seed, a, r in zip(run.seeds, areas, last, strict=True)
    ]


def measure(network: str, processes: int) -> None:
    """Train all rows of a network, and put its lines in the place of earlier ones."""
    with ThreadPoolExecutor(processes) as pool:
        measured = list(pool.map(partial(train, network), ROWS))
    kept = [line for line in read() if line["network"] != network]
    kept += [line for lines in measured for line in lines]
    with RESULTS.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(sorted(kept, key=lambda line: list(NETWORKS).index(line["network"])))


def read() -> list[dict[str, str]]:
    """Return the lines of what was measured."""
    if not RESULTS.is_file():
        return []
    with RESULTS.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def halves(areas: np.ndarray) -> float:
    """Return how far the means of two halves of some areas lie apart, at most in 95 % of splits."""
    chosen = combinations(range(len(areas)), len(areas) // 2)
    gaps = [abs(areas[list(one)].mean() - np.delete(areas, one).mean()) for one in chosen]
    return float(np.quantile(gaps, 0.95))


def table() -> Table:
    """Return a row per network and precision."""
    rows = [row for network in NETWORKS for row in _rows(network)]
    heads = ("network", "seeds", "precision", "area", "− float32 [95 %]", "halves")
    return Table(heads, rows)


def _rows(network: str) -> Iterator[tuple[str, ...]]:
    mine = [line for line in read() if line["network"] == network]
    usual = _areas(mine, "float32")
    for row in ROWS if mine else ():
        areas = _areas(mine, row)
        gap, apart = "", f"± {halves(areas):.0f}"
        if row != "float32":
            test = ttest_1samp(areas - usual, 0.0)
            low, high = test.confidence_interval()
            gap, apart = f"{(areas - usual).mean():+.0f} [{low:+.0f}, {high:+.0f}]", ""
        yield network, str(len(areas)), row, f"{areas.mean():.0f}", gap, apart


def _areas(lines: list[dict[str, str]], row: str) -> np.ndarray:
    return np.array([float(line["area"]) for line in lines if line["row"] == row])


def main() -> None:
    """Measure a network, or print what was measured."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--measure", choices=NETWORKS, help="train all seeds of this network")
    parser.add_argument("--processes", type=int, default=2, help="how many train at once")
    chosen = parser.parse_args()
    if chosen.measure:
        measure(chosen.measure, chosen.processes)
    Console().print(drawn(table()))


if __name__ == "__main__":
    main()
