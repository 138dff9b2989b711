"""Measure several sides in turns, so that what slows the machine slows all of them.

A side is measured in a process of its own, with a user's defaults: nothing that one side imports,
compiles or leaves spinning touches another. Ratios are of neighbours in time.
"""

import argparse
import csv
import json
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

Measurements = dict[str, np.ndarray]
"""Each side's number in each round, (rounds,)."""


def arguments(doc: str | None) -> argparse.Namespace:
    """Read the command line; `--side` is for the process that measures one."""
    parser = argparse.ArgumentParser(description=(doc or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5, help="how often each side is measured")
    parser.add_argument("--csv", type=Path, help="where to add what was measured, a line a side")
    parser.add_argument("--side", help=argparse.SUPPRESS)
    return parser.parse_args()


def in_turns(script: str, sides: Iterable[str], chosen: argparse.Namespace) -> Measurements:
    """Let a script measure each side in turn, A B A B; return what `--side NAME` printed."""
    found: dict[str, list[float]] = {side: [] for side in sides}
    for k in range(chosen.rounds):
        for side in found:
            print(f"\rround {k + 1} of {chosen.rounds}: {side:50}", end="", file=sys.stderr)
            command = [sys.executable, script, "--side", side]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                sys.exit(f"\n{side}:\n{done.stderr}")
            found[side].append(float(json.loads(done.stdout.splitlines()[-1])))
    print("\r" + " " * 72, end="\r", file=sys.stderr)
    if chosen.csv:
        with chosen.csv.open("a", newline="", encoding="utf-8") as file:
            rows = ([side, *(f"{n:.6g}" for n in numbers)] for side, numbers in found.items())
            csv.writer(file, lineterminator="\n").writerows(rows)
    return {side: np.array(numbers) for side, numbers in found.items()}


def answer(side: str, measures: Mapping[str, Callable[[], float]]) -> None:
    """Measure one side and print its number for `in_turns`."""
    print(json.dumps(measures[side]()))


def median(numbers: np.ndarray, digits: str) -> str:
    """Return the median of some numbers."""
    return format(float(np.median(numbers)), digits)


def span(numbers: np.ndarray, digits: str) -> str:
    """Return the median and the range of some numbers."""
    low, high = (format(float(n), digits) for n in (numbers.min(), numbers.max()))
    return f"{median(numbers, digits)} [{low}, {high}]"


def show(columns: Sequence[str], rows: Iterable[Sequence[str]], note: str) -> None:
    """Print a table whose first column names its rows, and what its numbers are."""
    table = Table(columns[0], box=None)
    for column in columns[1:]:
        table.add_column(column, justify="right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    Console().print(table)
    print(note + "\n")
