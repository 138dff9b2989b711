"""How long a user waits before anything happens: help, similarity, a first iteration, imports.

    python benchmarks/startup.py

Whole processes. "Cold" begins with numba's cache empty: it compiles and keeps what it compiled;
"warm" is every later time. What compiling costs is cold less warm.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from time import perf_counter

from turns import Measurements, Table, median, run, span

REFERENCE = "python -c 'import typer, rich'"
QUICK = ("repaint --help", "repaint similarity racer-inner racer-outer", "repaint tasks list")
LEAST = """
import typer
app = typer.Typer(rich_markup_mode=None, add_completion=False)
@app.command()
def least(names: list[str], as_json: bool = False) -> None:
    print(names)
app()
"""
"""What Typer itself takes to read arguments as `repaint similarity` has them."""
FIRST = {
    "reacher": "reacher --eval-episodes 1",
    "racer-inner": "racer-inner --eval-episodes 1 --set ppo.n_episodes=2 --set ppo.n_epochs=1",
    "racer-avoid": "racer-avoid --eval-episodes 1 --set ppo.n_episodes=2 --set ppo.n_epochs=1",
}
IMPORTS = (
    "repaint_cli.cli.app",
    "repaint_cli.tasks.task",
    "repaint_cli.policies.networks",
    "repaint_cli.runs.experiment",
)


def command(line: str) -> list[str]:
    """Return a command of this environment as a process wants it."""
    words = line.split()
    return [str(Path(sys.executable).parent / words[0]), *words[1:]]


def wait(words: list[str], **environment: str) -> float:
    """Return the seconds a process takes."""
    started = perf_counter()
    subprocess.run(words, check=True, capture_output=True, env={**os.environ, **environment})
    return perf_counter() - started


def first_iteration(task: str, cold: bool) -> float:
    """Return the seconds of a whole training of one iteration."""
    line = f"repaint transfer --method scratch --iterations 1 --task {FIRST[task]}"
    with tempfile.TemporaryDirectory() as folder:
        first, second = ([*command(line), "--run", f"{folder}/{run}"] for run in (1, 2))
        if cold:
            return wait(first, NUMBA_CACHE_DIR=folder)
        wait(first)  # so that the cache is there
        return wait(second)


def sides() -> dict[str, Callable[[], float]]:
    """Return what measures each side, by name."""
    python = partial(wait, [sys.executable, "-c", "import typer, rich"])
    named: dict[str, Callable[[], float]] = {REFERENCE: python}
    named |= {line: partial(wait, command(line)) for line in QUICK}
    named["a Typer command that prints its arguments"] = partial(
        wait, [sys.executable, "-c", LEAST, "racer-inner", "racer-outer"]
    )
    for module in IMPORTS:
        words = [sys.executable, "-c", f"import {module}"]
        named[f"import {module}"] = partial(wait, words)
    for task in FIRST:
        for state in ("cold", "warm"):
            named[f"{task}, {state}"] = partial(first_iteration, task, state == "cold")
    return named


SIDES = sides()


def tables(measured: Measurements) -> Iterator[Table]:
    """Yield whole processes beside the reference, then first iterations."""
    rows = []
    for side, seconds in measured.items():
        if not side.endswith(("cold", "warm")):
            ratio = span(seconds / measured[REFERENCE], ".2f")
            rows.append((side, median(1000 * seconds, ".0f"), ratio))
    yield Table(("a whole process", "ms", ": the first"), rows)
    rows = []
    for task in FIRST:
        cold, warm = measured[f"{task}, cold"], measured[f"{task}, warm"]
        rows.append((task, span(cold, ".1f"), span(warm, ".1f"), span(cold - warm, ".1f")))
    yield Table(("one iteration, s", "cold", "warm", "compiling"), rows)


if __name__ == "__main__":
    run(__file__, __doc__, SIDES, tables)
