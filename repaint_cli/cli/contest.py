"""Train several methods on the same seeds, each in a process of its own, for a comparison."""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import joblib

from repaint_cli.cards import read_task
from repaint_cli.cli.options import check_method, customize, method_for
from repaint_cli.cli.screen import out
from repaint_cli.cli.session import find_teachers, new_folder
from repaint_cli.errors import CardError, RepaintError
from repaint_cli.history import read_run
from repaint_cli.report.pictures import draw_run
from repaint_cli.runs import Experiment, Plan


def train_all(
    task: str,
    methods: str,
    teachers: Sequence[str] | None,
    seeds: list[int],
    iterations: int | None,
    settings: list[str] | None,
    jobs: int,
) -> list[Path]:
    """Train every method, as many at a time as there are jobs; return the runs' folders.

    Cores are shared out evenly, so that processes do not fight for them.

    Raises:
        NotFound: there is no such task, method or teacher.
        CardError: no method was named, one twice, or there is no job.
    """
    names = [name for name in methods.split(",") if name]
    if not names or len(set(names)) < len(names) or jobs < 1:
        raise CardError(
            "expected --methods such as scratch,kickstart,repaint, each once, and --jobs of at "
            f"least 1, found '{methods}' and {jobs}"
        )
    card = customize(read_task(task), settings, ppo__n_iterations=iterations)
    root = new_folder(None, card.name, "compare")
    plans = []
    for name in names:
        check_method(method_for("ppo", name))
        plans.append(Plan(card, name, seeds, root / name, find_teachers(teachers, name)))
    threads = max(1, (os.cpu_count() or 1) // jobs)
    with joblib.parallel_config("loky", inner_max_num_threads=threads):
        workers = joblib.Parallel(n_jobs=jobs, return_as="generator_unordered")
        for done, folder in enumerate(_trained(workers, plans, threads), 1):
            out.print(f"{done} of {len(plans)}: wrote [bold]{folder}/[/bold]")
    return [plan.folder for plan in plans]


def _trained(workers: joblib.Parallel, plans: list[Plan], threads: int) -> Iterator[Path]:
    """Yield the folders as the runs finish.

    Raises:
        RepaintError: what stopped a run, by its folder.
    """
    for folder, problem in workers(joblib.delayed(_train)(plan, threads) for plan in plans):
        if problem:
            raise problem
        yield folder


def _train(plan: Plan, threads: int) -> tuple[Path, RepaintError | None]:
    """Train as planned and draw the run, without a screen."""
    import torch

    torch.set_num_threads(threads)
    os.environ["OMP_NUM_THREADS"] = str(threads)
    try:
        experiment = Experiment(plan)
        for _ in experiment.run():
            pass
        experiment.policies()
        draw_run(read_run(plan.folder), experiment.reports)
    except RepaintError as error:
        return plan.folder, error
    return plan.folder, None
