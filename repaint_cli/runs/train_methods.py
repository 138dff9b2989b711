"""Train several methods on the same seeds, each in a process of its own, for a comparison."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from repaint_cli.errors import UsageError
from repaint_cli.runs.estimate import Estimate, estimate
from repaint_cli.runs.new_folder import make_new
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.start import checked_seeds, new_folder, on_this_machine
from repaint_cli.runs.with_teachers import choose, settled
from repaint_cli.runs.workers import measure_aside, threads_of, train_all
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.methods import METHODS, method_for

MANY_SEEDS, FEW_SEEDS = 10, 3
"""Seeds of each method where nobody says how many: of quick iterations, and of others."""


def usual_seeds(measured: Estimate) -> int:
    """Return how many seeds of each method are trained where nobody says how many."""
    return MANY_SEEDS if measured.quick else FEW_SEEDS


def measured(plan: Plan, jobs: int) -> Estimate:
    """Train a plan's first iterations in a temporary folder, as it would be trained; forget them.

    Raises:
        RepaintError: the run could not begin, or fails in these iterations.
    """
    return estimate(plan) if jobs == 1 else measure_aside(plan, threads_of(jobs))


def train_methods(
    card: TaskCard,
    methods: Sequence[str],
    teachers: Sequence[str],
    seeds: Sequence[int],
    jobs: int,
) -> Iterator[Path]:
    """Return an iterator that trains methods, as many at a time as there are jobs.

    It yields their folders as they finish. All is checked before anything is trained. Several jobs
    share the cores evenly, so that processes do not compete for them.

    Raises:
        NotFound: there is no such method or teacher.
        TeacherMismatch: a teacher does not fit the task.
        UsageError: there is no method, seed or job, one stands there twice, a seed is negative, or
            teachers are named and no method uses one.
    """
    return _carried_out(plan_methods(card, methods, teachers, seeds, jobs), jobs)


def check_methods(methods: Sequence[str], jobs: int) -> None:
    """Check that methods are named, each once, and that there is a job.

    Raises:
        UsageError: there is no method, one stands there twice, or there is no job.
    """
    if not methods or len(set(methods)) < len(methods):
        raise UsageError(f"expected methods, each once, found {', '.join(methods) or 'none'}")
    if jobs < 1:
        raise UsageError(f"expected at least 1 job, found {jobs}")


def plan_methods(
    card: TaskCard,
    methods: Sequence[str],
    teachers: Sequence[str],
    seeds: Sequence[int],
    jobs: int,
) -> list[Plan]:
    """Return a checked plan for each method, all in one folder, which is not made yet.

    Raises:
        As `train_methods`.
    """
    check_methods(methods, jobs)
    numbers, root = checked_seeds(seeds), new_folder(None, card.name, "compare")
    card = on_this_machine(card)
    plans = [Plan(card, method_for("ppo", name), numbers, root / name) for name in methods]
    taught = [plan for plan in plans if METHODS[plan.method].needs_teacher]
    if teachers and not taught:
        raise UsageError(
            f"expected methods that use a teacher, found {', '.join(methods)}; leave out "
            f"{', '.join(teachers)}"
        )
    if taught:  # by methods that share what their teachers play
        opens = [plan for plan in taught if plan.target.transfer.start != "untrained"]
        opens += [plan for plan in taught if plan.target.automatic]
        choice = choose([*opens, *taught][0], teachers)
        plans = [settled(plan, choice) if plan in taught else plan for plan in plans]
    for plan in plans:
        plan.check()  # better now than after the first method's hours
    return plans


def _carried_out(plans: Sequence[Plan], jobs: int) -> Iterator[Path]:
    """Make the plans' folder, and carry them out; yield their folders as they finish.

    Raises:
        RepaintError: what stopped a run.
    """
    root = make_new(plans[0].folder.parent)
    yield from train_all([replace(plan, folder=root / plan.method) for plan in plans], jobs)
