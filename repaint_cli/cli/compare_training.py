"""What `repaint compare --task` trains: how many seeds, how long it takes, and the training."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from repaint_cli.cli.compare_options import DEFAULT_METHODS, CompareOptions
from repaint_cli.cli.dry_run import dry_run
from repaint_cli.cli.engine_options import engine_options
from repaint_cli.cli.option_rules import settings_of
from repaint_cli.cli.option_values import parse_methods, seed_list
from repaint_cli.engines.options import EngineOptions, RunsWatcher
from repaint_cli.errors import UsageError

if TYPE_CHECKING:
    from rich.console import Console

    from repaint_cli.runs.estimate import Estimate
    from repaint_cli.runs.plan import Plan
    from repaint_cli.tasks.card import TaskCard


def print_what_would_run(options: CompareOptions) -> None:
    """Print what would be trained."""
    methods, how = methods_and_engine(options)
    task, card = _cards(options)

    def plans() -> "Sequence[Plan]":
        from repaint_cli.engines.train_methods import plan_methods

        seeds = _seeds(options)
        if seeds is None:
            seeds = _usual_seeds(options, _measured(options, card, methods, how))
        return plan_methods(card, methods, options.teacher or (), seeds)

    dry_run(task, plans, how.jobs or 1)


def methods_and_engine(options: CompareOptions) -> tuple[list[str], EngineOptions]:
    """Return the methods that are to be trained, and how.

    Raises:
        UsageError: an option is malformed, or there are several methods for --aa.
    """
    usual = "scratch" if options.aa else DEFAULT_METHODS
    jobs = 1 if options.jobs is None else options.jobs
    methods = parse_methods(usual if options.methods is None else options.methods, jobs)
    if options.aa and len(methods) > 1:
        raise UsageError(f"expected one of --methods with --aa, found {', '.join(methods)}")
    return methods, engine_options(options)


def train(options: CompareOptions, folders: list[Path]) -> list[Path]:
    """Train the methods that are to be compared; return their runs' folders."""
    from rich.console import Console

    import repaint_cli
    from repaint_cli.cli.namesakes import print_notes
    from repaint_cli.runs.compare import check_reference

    methods, how = methods_and_engine(options)
    check_reference(options.reference, folders, methods)
    _, card = _cards(options)
    seeds, teachers = _seeds(options), options.teacher or ()
    print_notes(*teachers)
    screen = Console(stderr=True, soft_wrap=True, highlight=False)
    measured = _measured(options, card, methods, how)
    few = seeds is None and not measured.quick
    seeds = _usual_seeds(options, measured) if seeds is None else seeds
    _print_estimate(screen, measured, len(methods), len(seeds), how.jobs or 1, few=few)
    trained = _shown(
        screen,
        lambda watcher: repaint_cli.train_methods(
            card, methods, teachers, seeds, how, watcher, options.into
        ),
    )
    return sorted(trained, key=lambda folder: methods.index(folder.name))


def go_on(options: CompareOptions, folders: list[Path]) -> list[Path]:
    """Go on with the runs that an earlier command trained; return their folders."""
    from rich.console import Console

    from repaint_cli.engines.train_methods import resume_methods
    from repaint_cli.runs.compare import check_reference
    from repaint_cli.runs.kept_records import kept_records

    how, root = engine_options(options), options.resume
    assert root is not None
    names = list(kept_records(root))
    check_reference(options.reference, folders, names)
    screen = Console(stderr=True, soft_wrap=True, highlight=False)
    trained = _shown(screen, lambda watcher: resume_methods(root, how, watcher))
    return sorted(trained, key=lambda folder: names.index(folder.name))


def _shown(screen: "Console", train: "Callable[[RunsWatcher], Iterator[Path]]") -> list[Path]:
    """Train runs, and show how far they are; return their folders as they finish."""
    from repaint_cli.cli.live import live
    from repaint_cli.cli.runs_screen import RunsScreen

    watcher, trained = RunsScreen(screen), list[Path]()
    with live(screen, note=watcher.table):
        for folder in train(watcher):
            trained.append(folder)
            watcher.wrote(folder)
    return trained


def _cards(options: CompareOptions) -> "tuple[TaskCard, TaskCard]":
    """Return the task's card as it is, and as it is trained on."""
    import repaint_cli
    from repaint_cli.tasks.presets import with_preset

    task = repaint_cli.load_task(options.task or "")
    return task, with_preset(task, options.preset).with_settings(settings_of(options))


def _seeds(options: CompareOptions) -> list[int] | None:
    """Return the seeds that --seeds and --seed ask for; None where there is no --seeds."""
    if options.seeds is None:
        seed_list(options.seed or 0, 1)  # refuses a first seed that is none
        return None
    seeds = seed_list(options.seed or 0, options.seeds)
    if options.aa:
        from repaint_cli.runs.against_itself import check_seeds

        check_seeds(len(seeds))
    return seeds


def _usual_seeds(options: CompareOptions, measured: "Estimate") -> list[int]:
    """Return as many seeds as the time that an iteration takes allows for; twice that for --aa."""
    from repaint_cli.engines.train_methods import usual_seeds

    return seed_list(options.seed or 0, usual_seeds(measured) * (1 + options.aa))


def _measured(
    options: CompareOptions, card: "TaskCard", methods: Sequence[str], how: EngineOptions
) -> "Estimate":
    """Check all that will be trained, and measure first iterations of one seed of one method."""
    from rich.console import Console

    from repaint_cli.activity import doing
    from repaint_cli.cli.live import live
    from repaint_cli.engines.train_methods import measured, plan_methods

    first, *_ = plan_methods(card, methods, options.teacher or (), [options.seed or 0])
    with live(Console(stderr=True)), doing(f"measuring {first.method}"):
        return measured(first, how)


def _print_estimate(
    screen: "Console", measured: "Estimate", methods: int, seeds: int, jobs: int, *, few: bool
) -> None:
    """Print about how long the training takes, and whether its seeds are too few."""
    from repaint_cli.runs.comparison_words import duration

    n, each = measured.n_iterations, measured.of_an_iteration
    side = f", with --jobs {jobs} less" if jobs > 1 else ""
    screen.print(
        f"about {duration(measured.seconds * methods * seeds)}{side}: {methods} "
        f"method{'s' * (methods > 1)}, {seeds} seed{'s' * (seeds > 1)}, {n:,} iterations of "
        f"{each:.2g} s each"
    )
    if few:
        screen.print(
            f"[yellow]warning:[/yellow] only {seeds} seeds, since an iteration takes more than a "
            "second: they show large differences only; --seeds 10 shows more"
        )
