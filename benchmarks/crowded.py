"""What other processes cost a training with its default threads, beside one with a single thread.

    python benchmarks/crowded.py

Whole processes: two joint iterations of Reacher, and a short camera training. None, one or two busy
processes are there before, or come three seconds later; they have the same priority, or a higher
one (ours is nice 5). The last column is to stay below 1.1, however crowded the machine is.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from time import perf_counter
from typing import NamedTuple

from turns import Measurements, Table, median, run, span

TRAININGS = {
    "reacher": "--task reacher --teacher reacher-gentle --method repaint-joint --iterations 2",
    "racer": "--task racer-inner --method scratch --iterations 1 --eval-episodes 1 "
    "--set ppo.n_episodes=4 --set ppo.n_epochs=2",
}
LIMIT_S = 300.0
"""Whoever takes longer has collapsed; its number is this one."""


class Crowd(NamedTuple):
    """Who else is busy."""

    processes: int = 0
    delay_s: float = 0.0
    """After which they begin."""
    niceness: int = 0
    """Of our process; theirs is 0."""

    def __str__(self) -> str:
        if not self.processes:
            return "nobody else"
        when = "later" if self.delay_s else "before"
        return f"{self.processes} {when}{', higher priority' if self.niceness else ''}"


CROWDS = (
    Crowd(),
    *(Crowd(n, delay, nice) for nice in (0, 5) for delay in (0.0, 3.0) for n in (1, 2)),
)
THREADS = {"default": {}, "one thread": {"OMP_NUM_THREADS": "1"}}


@contextmanager
def busy(crowd: Crowd) -> Iterator[None]:
    """Let others be busy meanwhile."""
    program = f"import time; time.sleep({crowd.delay_s})\nwhile True: pass"
    others = [subprocess.Popen([sys.executable, "-c", program]) for _ in range(crowd.processes)]
    try:
        yield
    finally:
        for other in others:
            other.kill()
            other.wait()


def seconds(training: str, crowd: Crowd, threads: dict[str, str]) -> float:
    """Return how long a training takes among others, from its start to its end."""
    with tempfile.TemporaryDirectory() as folder, busy(crowd):
        words = [*TRAININGS[training].split(), "--run", f"{folder}/run"]
        command = [sys.executable, "-m", "repaint_cli", "transfer", *words]
        environment = {k: v for k, v in os.environ.items() if k != "OMP_NUM_THREADS"}
        started = perf_counter()
        try:
            subprocess.run(
                ["nice", "-n", str(crowd.niceness), *command], check=True, capture_output=True,
                env=environment | threads | {"REPAINT_HOME": folder}, timeout=LIMIT_S,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return LIMIT_S
        return perf_counter() - started


SIDES = {
    f"{training}, {crowd}, {name}": partial(seconds, training, crowd, threads)
    for training in TRAININGS for crowd in CROWDS for name, threads in THREADS.items()
}  # fmt: skip


def tables(measured: Measurements) -> Iterator[Table]:
    """Yield a table per training, a row per crowd."""
    for training in TRAININGS:
        rows = []
        for crowd in CROWDS:
            ours, single = (measured[f"{training}, {crowd}, {name}"] for name in THREADS)
            rows.append(
                (str(crowd), median(ours, ".1f"), median(single, ".1f"), span(ours / single, ".2f"))
            )
        yield Table((f"{training}, seconds", *THREADS, "default : one thread"), rows)


if __name__ == "__main__":
    run(__file__, __doc__, SIDES, tables)
