"""Train several methods on the same seeds, each in a process of its own, for a comparison."""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import joblib

from repaint_cli.errors import RepaintError, UsageError
from repaint_cli.runs.experiment import Experiment
from repaint_cli.runs.figures import draw_run
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.reader import read_run
from repaint_cli.runs.start import checked_seeds, find_teachers, new_folder
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.methods import method_for


def plan_methods(
    card: TaskCard, methods: Sequence[str], teachers: Sequence[str], seeds: Sequence[int]
) -> list[Plan]:
    """Return a plan for each method, all in one new folder, checked.

    Raises:
        NotFound: there is no such method or teacher.
        TeacherMismatch: a teacher does not fit the task.
        UsageError: there is no method or seed, or one stands there twice, or a seed is negative.
    """
    if not methods or len(set(methods)) < len(methods):
        raise UsageError(f"expected methods, each once, found {', '.join(methods) or 'none'}")
    numbers, root, plans = checked_seeds(seeds), new_folder(None, card.name, "compare"), []
    for name in methods:
        paths = find_teachers(teachers, method_for("ppo", name))
        plans.append(Plan(card, name, numbers, root / name, paths))
        plans[-1].check()  # better now than after the first method's hours
    return plans


def train_plans(plans: Sequence[Plan], jobs: int = 1) -> Iterator[Path]:
    """Carry out plans, as many at a time as there are jobs; yield the folders as they finish.

    Several jobs share the cores evenly, so that processes do not compete for them.

    Raises:
        UsageError: there is no job.
        RepaintError: what stopped a run.
    """
    if jobs < 1:
        raise UsageError(f"expected at least 1 job, found {jobs}")
    threads = None if jobs == 1 else max(1, _cores() // jobs)
    with joblib.parallel_config("loky", inner_max_num_threads=threads):
        workers = joblib.Parallel(n_jobs=jobs, return_as="generator_unordered")
    return _carried_out(plans, workers, threads)


def _carried_out(
    plans: Sequence[Plan], workers: joblib.Parallel, threads: int | None
) -> Iterator[Path]:
    for folder, problem in workers(joblib.delayed(_train)(plan, threads) for plan in plans):
        if problem:
            raise problem
        yield folder


def _cores() -> int:
    """Return how many cores there are for us: OMP_NUM_THREADS where set, else all."""
    wanted = os.environ.get("OMP_NUM_THREADS", "")
    return int(wanted) if wanted.isdecimal() and int(wanted) else os.cpu_count() or 1


def _train(plan: Plan, threads: int | None) -> tuple[Path, RepaintError | None]:
    """Train as planned and draw the run; a process of several has its own threads."""
    if threads:
        os.environ["OMP_NUM_THREADS"] = str(threads)  # which EnvPool reads
    try:
        experiment = Experiment.begin(plan)
        for _ in experiment.run():
            pass
        experiment.policies()
        draw_run(read_run(plan.folder))
    except RepaintError as error:
        return plan.folder, error
    return plan.folder, None
