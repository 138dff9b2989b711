"""What it takes to put an iteration on disk, in a fresh run and with 20,000 iterations behind it.

    python benchmarks/records.py

Milliseconds for everything that is written of an iteration, checkpoint and best policy among it:
of a Reacher run of three seeds and of a race of one. Nothing is learned meanwhile: an iteration
that was learned once is put on disk again and again, under the next number.
"""

import json
import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import median as middle
from tempfile import TemporaryDirectory
from time import perf_counter

from turns import Measurements, Table, median, run, span

from repaint_cli.envs.racer.deepracer.simtrace import METRICS_FILE
from repaint_cli.envs.racer.deepracer.simtrace_reader import TRAINING
from repaint_cli.envs.racer.deepracer.training_metrics import TrainingMetrics
from repaint_cli.runs.experiment import Experiment
from repaint_cli.runs.metrics import Report, append_csv
from repaint_cli.runs.owner import new_run
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.record import MOST_ALARMS
from repaint_cli.runs.record_parts import Alarm
from repaint_cli.tasks.card_files import read_task

BEHIND, TIMES = 20_000, 40
QUICK = ["ppo.n_epochs=1", "eval.episodes=5"]
RUNS = {
    "Reacher": ("reacher", [0, 1, 2], [*QUICK, "ppo.n_steps=204", "ppo.n_envs=4"]),
    "race": (
        "racer-inner", [0],
        [*QUICK, "ppo.n_episodes=20", "env.max_steps=40", "net.conv=[[4,8,8]]", "net.dense=8"],
    ),
}  # fmt: skip
"""Task, seeds and settings: small networks, whose size does not grow with the iterations."""


def record(kind: str, behind: int) -> float:
    """Return the median time of an iteration's record with so many iterations behind it."""
    task, seeds, settings = RUNS[kind]
    card = read_task(task).with_settings([*settings, "ppo.n_iterations=2"])
    with (
        TemporaryDirectory(dir=Path.cwd()) as folder,
        new_run(Plan(card, "scratch", seeds, Path(folder) / "run")) as experiment,
    ):
        iterations = experiment.run()
        report = next(iterations)
        lengthen(experiment, report, behind)
        taken = [seconds(experiment, report, behind + 2 + i) for i in range(TIMES)]
        del iterations
    return 1000 * middle(taken)


def seconds(experiment: Experiment, report: Report, k: int) -> float:
    """Return how long it takes to put a report on disk as that of iteration k."""
    experiment.learner.iteration = k
    later = replace(report, stats=replace(report.stats, iteration=k))
    started = perf_counter()
    experiment.save(later)
    return perf_counter() - started


def lengthen(experiment: Experiment, report: Report, n: int) -> None:
    """Let a run's folder hold n iterations more, all of them like its first."""
    if not n:
        return
    files, first = experiment.plan.files, report.stats.iteration
    rows = [
        row | {"seed": seed, "iteration": first + k}
        for k in range(1, n + 1)
        for row, seed in zip(report.rows, experiment.plan.seeds, strict=True)
    ]
    append_csv(files.metrics, rows)
    for k in range(first + 1, first + n + 1):
        os.link(files.evaluation(first), files.evaluation(k))
    alarms = [Alarm(iteration=k, kind="nothing-kept", text=100 * "x") for k in range(MOST_ALARMS)]
    experiment.record.add_alarms(alarms, files)
    if logs := experiment.card.env.logs:
        for log in logs.folders(experiment.plan.folder, experiment.plan.seeds):
            lengthen_log(log, first, n)


def lengthen_log(log: Path, first: int, n: int) -> None:
    """Let the log of a race hold n iterations more."""
    traces = log / TRAINING
    for k in range(first, first + n):
        os.link(traces / f"{first - 1}-iteration.csv", traces / f"{k}-iteration.csv")
    entries = json.loads((log / METRICS_FILE).read_text(encoding="utf-8"))["metrics"]
    metrics = TrainingMetrics(log / METRICS_FILE)
    metrics.cut(len(entries))
    for _ in range(n // 1000):
        metrics.append(entries * 1000)


SIDES: dict[str, Callable[[], float]] = {
    f"{kind}, {behind:,} behind": partial(record, kind, behind)
    for kind in RUNS
    for behind in (0, BEHIND)
}


def tables(measured: Measurements) -> Iterator[Table]:
    """Yield a row per kind of run."""
    rows = []
    for kind in RUNS:
        fresh, late = measured[f"{kind}, 0 behind"], measured[f"{kind}, {BEHIND:,} behind"]
        rows.append((kind, median(fresh, ".1f"), median(late, ".1f"), span(late / fresh, ".2f")))
    columns = ("ms for an iteration's record", "fresh", f"{BEHIND:,} behind", "late : fresh")
    yield Table(columns, rows)


if __name__ == "__main__":
    run(__file__, __doc__, SIDES, tables)
