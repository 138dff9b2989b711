"""Train several methods on the same seeds for a comparison, with an engine."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from repaint_cli.engines.engine import Outcome, RunsFailed
from repaint_cli.engines.local import measure_aside, threads_of
from repaint_cli.engines.options import EngineOptions, RunsWatcher
from repaint_cli.engines.root import driven
from repaint_cli.errors import StoreError, UsageError
from repaint_cli.files.commands import command
from repaint_cli.runs.estimate import Estimate, estimate
from repaint_cli.runs.folder import PLANS
from repaint_cli.runs.kept_plans import check_same, keep_plans, kept_plans
from repaint_cli.runs.new_folder import make_new
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.start import checked_seeds, new_folder, on_this_machine
from repaint_cli.runs.with_teachers import choose, settled
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.methods import METHODS, method_for

MANY_SEEDS, FEW_SEEDS = 10, 3
"""Seeds of each method where nobody says how many: of quick iterations, and of others."""


def usual_seeds(measured: Estimate) -> int:
    """Return how many seeds of each method are trained where nobody says how many."""
    return MANY_SEEDS if measured.quick else FEW_SEEDS


def measured(plan: Plan, options: EngineOptions) -> Estimate:
    """Train a plan's first iterations in a temporary folder, as it would be here; forget them.

    Raises:
        RepaintError: the run could not begin, or fails in these iterations.
    """
    jobs, threads = options.jobs or 1, options.cpus_per_run
    if jobs == 1 and not threads:
        return estimate(plan)
    return measure_aside(plan, threads or threads_of(jobs))


def train_methods(
    card: TaskCard,
    methods: Sequence[str],
    teachers: Sequence[str],
    seeds: Sequence[int],
    jobs: int | EngineOptions,
    watcher: RunsWatcher | None = None,
    into: str | Path | None = None,
) -> Iterator[Path]:
    """Return an iterator that trains methods; it yields their folders as they finish.

    All is checked before anything is trained. `jobs` is how many train at a time, or an engine's
    options; `into` is the folder of the runs, a new one below runs/ where absent. Where the same
    was begun there, that goes on.

    Raises:
        NotFound: there is no such method or teacher.
        TeacherMismatch: a teacher does not fit the task.
        UsageError: there is no method, seed or job, one stands there twice, a seed is negative, or
            teachers are named and no method uses one.
    """
    options = EngineOptions.of(jobs)
    plans = plan_methods(card, methods, teachers, seeds)
    if into is not None:
        plans = [replace(plan, folder=Path(into, plan.method)) for plan in plans]
        _check_root(plans, Path(into))
    begun = partial(_begun, plans, named=into is not None)
    return _carried_out(begun, options, watcher or RunsWatcher())


def _check_root(plans: Sequence[Plan], root: Path) -> None:
    """Check that a folder is free, or that the same was begun in it.

    Raises:
        StoreError: it holds something else.
    """
    if (root / PLANS).is_file():
        check_same(plans, root)
    elif root.exists() and not (root.is_dir() and not any(root.iterdir())):
        raise StoreError(f"{root} is there and holds no comparison; name another with --into")


def resume_methods(
    root: Path, options: EngineOptions, watcher: RunsWatcher | None = None
) -> Iterator[Path]:
    """Return an iterator that goes on with what `train_methods` began in a folder.

    It yields all folders, first those of runs that are finished already.

    Raises:
        As `kept_plans`.
    """
    options.check()
    plans = kept_plans(root)
    return _carried_out(lambda: plans, options, watcher or RunsWatcher())


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
    jobs: int = 1,
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


def _begun(plans: Sequence[Plan], *, named: bool) -> Sequence[Plan]:
    """Keep plans in their folder, a new one unless it was named; return those that are there."""
    root = plans[0].folder.parent
    if not named:
        root = make_new(root)
        plans = [replace(plan, folder=root / plan.method) for plan in plans]
    if (root / PLANS).is_file():
        return kept_plans(root)
    keep_plans(plans, root)
    return plans


def _carried_out(
    begun: Callable[[], Sequence[Plan]], options: EngineOptions, watcher: RunsWatcher
) -> Iterator[Path]:
    """Carry out plans that are kept in their folder; yield their folders as they finish.

    `begun` makes the folder, once there is an engine.

    Raises:
        Locked: another command trains them.
        EngineError: the engine cannot be reached, or a node does not see the folder.
        RunsFailed: some failed.
    """
    failed = list[Outcome]()
    with options.open(watcher) as engine:
        plans = begun()
        root = plans[0].folder.parent
        with driven(root, engine.driver):
            watcher.training(plans)
            for outcome in engine.run(plans):
                if outcome.error:
                    failed.append(outcome)
                    watcher.failed(outcome)
                else:
                    yield outcome.folder
    if failed:
        again = command("repaint compare --resume {}", root) + options.words
        raise RunsFailed.of(failed, len(plans), again) from failed[0].error
