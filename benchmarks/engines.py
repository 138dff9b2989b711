"""What an engine costs, and what a second worker brings: processes of this machine beside Ray.

    pip install ray; python benchmarks/engines.py --rounds 3

Four runs of Reacher from scratch, one thread each. "train" is all of them, from the first process
to the last file; "begin" is what comes before the first run; "run" is a run that is finished
already, so that only its process is begun and asked.
"""

import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from time import perf_counter

from turns import Measurements, Table, run, span

from repaint_cli.engines.engine import Engine
from repaint_cli.engines.options import EngineOptions, RunsWatcher
from repaint_cli.runs.plan import Plan
from repaint_cli.tasks.card_files import read_task

RUNS = 4
ENGINES = {"local": "local", "ray": "ray:local"}


def plans(folder: str, iterations: int) -> list[Plan]:
    """Return the runs that are trained."""
    card = read_task("reacher").with_settings([f"ppo.n_iterations={iterations}"])
    return [Plan(card, "scratch", [seed], Path(folder, str(seed))) for seed in range(RUNS)]


def carry_out(engine: Engine, runs: list[Plan]) -> float:
    """Return how long an engine takes for runs, s."""
    before = perf_counter()
    for outcome in engine.run(runs):
        if outcome.error:
            raise outcome.error
    return perf_counter() - before


def train(name: str, jobs: int) -> float:
    """Return how long the runs take, s."""
    with tempfile.TemporaryDirectory() as folder:
        runs, options = plans(folder, 12), EngineOptions(ENGINES[name], jobs, cpus_per_run=1)
        with options.open(RunsWatcher()) as engine:
            carry_out(engine, plans(str(Path(folder, "first")), 1)[:1])  # which compiles
            return carry_out(engine, runs)


def begin(name: str) -> float:
    """Return how long it takes until an engine is there and has looked at the folder, s."""
    with tempfile.TemporaryDirectory() as folder:
        before, options = perf_counter(), EngineOptions(ENGINES[name], 1, cpus_per_run=1)
        with options.open(RunsWatcher()) as engine:
            first = carry_out(engine, plans(folder, 1)[:1])
            again = carry_out(engine, plans(folder, 1)[:1])
            return perf_counter() - before - first - again


def finished(name: str) -> float:
    """Return how long it takes to ask a process about a run, s."""
    options = EngineOptions(ENGINES[name], 1, cpus_per_run=1)
    with tempfile.TemporaryDirectory() as folder, options.open(RunsWatcher()) as engine:
        carry_out(engine, plans(folder, 1))
        return carry_out(engine, plans(folder, 1)) / RUNS


SIDES: dict[str, Callable[[], float]] = {
    f"train {name} {jobs}": partial(train, name, jobs) for name in ENGINES for jobs in (1, 2)
}
SIDES |= {f"run {name}": partial(finished, name) for name in ENGINES} | {
    "begin ray": partial(begin, "ray")
}


def tables(measured: Measurements) -> Iterator[Table]:
    """Yield the seconds, and how much faster two are than one."""
    yield Table(("what", "s"), [(side, span(seconds, ".1f")) for side, seconds in measured.items()])
    yield Table(
        ("two workers against one", "times as fast"),
        [(n, span(measured[f"train {n} 1"] / measured[f"train {n} 2"], ".2f")) for n in ENGINES],
    )


if __name__ == "__main__":
    run(__file__, __doc__, SIDES, tables)
