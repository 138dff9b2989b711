"""Measure several sides in turns, so that what slows the machine slows all of them.

A side is measured in a process of its own, with a user's defaults: nothing that one side imports,
compiles or leaves spinning touches another. Ratios are of neighbours in time.
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from rich.console import Console
from rich.table import Table

Measurements = dict[str, np.ndarray]
"""Each side's number in each round, (rounds,)."""


def in_turns(script: str, sides: Sequence[str], rounds: int) -> Measurements:
    """Let a script measure each side in turn, A B A B; return what `--side NAME` printed."""
    found: dict[str, list[float]] = {side: [] for side in sides}
    for k in range(rounds):
        for side in sides:
            print(f"\rround {k + 1} of {rounds}: {side:50}", end="", file=sys.stderr)
            command = [sys.executable, script, "--side", side]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                sys.exit(f"\n{side}:\n{done.stderr}")
            found[side].append(float(json.loads(done.stdout.splitlines()[-1])))
    print("\r" + " " * 72, end="\r", file=sys.stderr)
    return {side: np.array(numbers) for side, numbers in found.items()}


def arguments(doc: str | None, rounds: int = 5) -> argparse.Namespace:
    """Read the command line: `--rounds`, and `--side` for the process that measures one."""
    parser = argparse.ArgumentParser(description=(doc or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=rounds)
    parser.add_argument("--side", help=argparse.SUPPRESS)
    return parser.parse_args()


def answer(side: str, measures: Mapping[str, Callable[[], float]]) -> None:
    """Measure one side and print its number for `in_turns`."""
    print(json.dumps(measures[side]()))


def span(numbers: np.ndarray, digits: str) -> str:
    """Return the median and the range of some numbers."""
    low, middle, high = (format(float(q), digits) for q in np.quantile(numbers, (0, 0.5, 1)))
    return f"{middle} [{low}, {high}]"


def show(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], note: str) -> None:
    """Print a table, and what its numbers are."""
    table = Table("", *columns, title=title, box=None, title_justify="left")
    for row in rows:
        table.add_row(*row)
    Console().print(table)
    print(note + "\n")
