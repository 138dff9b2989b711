"""Measure several sides in turns, so that what slows the machine slows all of them.

A side is measured in a process of its own, with a user's defaults: nothing that one side imports,
compiles or leaves spinning touches another. Ratios are of neighbours in time.
"""

import argparse
import csv
import json
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rich.table
from rich.console import Console

RESULTS = Path(__file__).parent / "results"

Measurements = dict[str, np.ndarray]
"""Each side's number in each round, (rounds,)."""


class Table(NamedTuple):
    """What people read."""

    columns: Sequence[str]
    """What the columns are; the first names the rows."""
    rows: Sequence[Sequence[str]]
    """The cells."""


def run(
    script: str,
    doc: str | None,
    sides: Mapping[str, Callable[[], float]],
    tables: Callable[[Measurements], Iterator[Table]],
) -> None:
    """Be a benchmark's command line: measure all sides in turns and print the tables.

    With `--side` it measures one and prints its number; with `--keep` it writes what was measured
    to benchmarks/results/, where the tables in docs/speed.md come from.
    """
    parser = argparse.ArgumentParser(description=(doc or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5, help="how often each side is measured")
    parser.add_argument("--keep", action="store_true", help="write to benchmarks/results/")
    parser.add_argument("--side", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.side:
        print(json.dumps(sides[chosen.side]()))
        return
    measured = in_turns(script, sides, chosen.rounds)
    if chosen.keep:
        keep(measured, script)
    for table in tables(measured):
        Console().print(drawn(table))
        print()
    print(f"{chosen.rounds} rounds: median, or median [range]")


def in_turns(script: str, sides: Iterable[str], rounds: int) -> Measurements:
    """Let a script measure each side in turn, A B A B; return what `--side NAME` printed."""
    measured: dict[str, list[float]] = {side: [] for side in sides}
    for k in range(rounds):
        for side in measured:
            print(f"\rround {k + 1} of {rounds}: {side:50}", end="", file=sys.stderr)
            command = [sys.executable, script, "--side", side]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                sys.exit(f"\n{side}:\n{done.stderr}")
            measured[side].append(float(json.loads(done.stdout.splitlines()[-1])))
    print("\r" + " " * 72, end="\r", file=sys.stderr)
    return {side: np.array(numbers) for side, numbers in measured.items()}


def file_of(script: str) -> Path:
    """Return where a benchmark's measurements are kept."""
    return RESULTS / f"{Path(script).stem}.csv"


def keep(measured: Measurements, script: str) -> None:
    """Write measurements, a line a side."""
    with file_of(script).open("w", newline="", encoding="utf-8") as file:
        rows = ([side, *(f"{n:.6g}" for n in numbers)] for side, numbers in measured.items())
        csv.writer(file, lineterminator="\n").writerows(rows)


def kept(script: str) -> Measurements:
    """Read what `keep` wrote."""
    with file_of(script).open(newline="", encoding="utf-8") as file:
        return {side: np.array(numbers, float) for side, *numbers in csv.reader(file)}


def median(numbers: np.ndarray, digits: str) -> str:
    """Return the median of some numbers."""
    return format(float(np.median(numbers)), digits)


def span(numbers: np.ndarray, digits: str) -> str:
    """Return the median and the range of some numbers."""
    low, high = (format(float(n), digits) for n in (numbers.min(), numbers.max()))
    return f"{median(numbers, digits)} [{low}, {high}]"


def drawn(table: Table) -> rich.table.Table:
    """Return a table as a terminal shows it."""
    picture = rich.table.Table(table.columns[0], box=None)
    for column in table.columns[1:]:
        picture.add_column(column, justify="right", no_wrap=True)
    for row in table.rows:
        picture.add_row(*row)
    return picture


def markdown(table: Table) -> Iterator[str]:
    """Yield a table's lines as Markdown has them."""
    yield f"| {' | '.join(table.columns)} |"
    yield "|---" + "|---:" * (len(table.columns) - 1) + "|"
    for row in table.rows:
        yield f"| {' | '.join(row)} |"
