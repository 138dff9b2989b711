"""`repaint compare`."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from repaint_cli.cli.compare_options import DEFAULT_METHODS, CompareOptions
from repaint_cli.cli.dry_run import dry_run
from repaint_cli.cli.option_rules import check_together, parsed_into, settings_of
from repaint_cli.cli.option_values import parse_methods, parse_target, seed_list
from repaint_cli.files.commands import command

if TYPE_CHECKING:
    from repaint_cli.runs.compare import ComparedRuns, EvaluatedRun
    from repaint_cli.runs.comparison import Comparison
    from repaint_cli.runs.plan import Plan


@parsed_into(CompareOptions)
def compare(options: CompareOptions) -> None:
    """Compare runs of a task, or train them first.

    By return, and by the iterations, steps and time to a target score, with intervals over seeds.

    Examples:
        repaint compare runs/reacher/* --report report
        repaint compare --task reacher --teacher reacher-gentle --jobs 2
    """
    target = parse_target(options.target)
    check_together(options)
    if options.dry_run:
        return _dry_run(options)
    folders = list(options.folders or [])
    if options.task:
        folders += _train(options, folders)
    if options.trajectories:
        return _play(options, folders)
    return _compare(options, folders, target)


def _dry_run(options: CompareOptions) -> None:
    """Print what would be trained."""
    import repaint_cli

    methods, seeds, jobs = _asked_for(options)
    task = repaint_cli.load_task(options.task or "")
    card = task.with_settings(settings_of(options))

    def plans() -> "Sequence[Plan]":
        from repaint_cli.runs.train_methods import plan_methods

        return plan_methods(card, methods, options.teacher or (), seeds, jobs)

    dry_run(task, plans, jobs)


def _asked_for(options: CompareOptions) -> tuple[list[str], list[int], int]:
    """Return the methods that are to be trained, their seeds, and how many runs at a time."""
    methods = DEFAULT_METHODS if options.methods is None else options.methods
    seeds = seed_list(options.seed or 0, 3 if options.seeds is None else options.seeds)
    jobs = 1 if options.jobs is None else options.jobs
    return parse_methods(methods, jobs), seeds, jobs


def _compare(options: CompareOptions, folders: list[Path], target: float | None) -> None:
    """Compare runs by their returns; print the numbers before anything is written."""
    import repaint_cli
    from repaint_cli.cli.comparison_table import print_comparison
    from repaint_cli.cli.printing import print_written

    def show(comparison: "Comparison") -> None:
        if options.json:
            print(json.dumps(comparison.as_json(), indent=2))
        else:
            print_comparison(comparison)

    compared = repaint_cli.compare(
        folders,
        reference=options.reference,
        target=target,
        picture=options.output,
        report=options.report,
        on_comparison=show,
        replace=options.replace,
    )
    if not options.json:
        print_written(compared.written, _next_command(compared, options.report))


def _next_command(compared: "ComparedRuns", report: Path | None) -> str:
    """Return the next command worth typing: to see the report, to write it, or to train scratch."""
    from repaint_cli.runs.comparison_report import report_command
    from repaint_cli.runs.run_command import scratch_command

    if report:
        return command("repaint open {}", report)
    if len(compared.runs) > 1:
        following = report_command(compared.runs, compared.comparison, Path("report"))
    else:
        run = next(iter(compared.runs.values()))
        following = scratch_command(run.record, run.task) or command("repaint open {}", run.folder)
    return following.replace("\\\n    ", "")


def _train(options: CompareOptions, folders: list[Path]) -> list[Path]:
    """Train the methods that are to be compared; return their runs' folders."""
    from rich.console import Console

    import repaint_cli
    from repaint_cli.cli.live import live
    from repaint_cli.cli.namesakes import print_notes
    from repaint_cli.runs.compare import check_places, check_reference

    paths = options.trajectories
    check_places(options.output, options.report, paths=paths, replace=options.replace)
    methods = DEFAULT_METHODS if options.methods is None else options.methods
    check_reference(options.reference, folders, methods.split(","))
    names, seeds, jobs = _asked_for(options)
    card = repaint_cli.load_task(options.task or "").with_settings(settings_of(options))
    print_notes(*(options.teacher or ()))
    screen, trained = Console(stderr=True, soft_wrap=True, highlight=False), list[Path]()
    with live(screen):
        for folder in repaint_cli.train_methods(card, names, options.teacher or (), seeds, jobs):
            trained.append(folder)
            screen.print(f"{len(trained)} of {len(names)}: wrote [bold]{folder}/[/bold]")
    return sorted(trained, key=lambda folder: names.index(folder.name))


def _play(options: CompareOptions, folders: list[Path]) -> None:
    """Let the last policies of runs play, and draw their paths side by side."""
    import repaint_cli
    from repaint_cli.cli.episode_table import table
    from repaint_cli.cli.printing import out, print_written

    def show(one: "EvaluatedRun") -> None:
        if not options.json:
            shown = table(one.label, one.run.seeds, one.run.task.env, one.episodes)
            out.print(shown, soft_wrap=False)

    picture = options.output or Path("compare-trajectories.png")
    evaluated = repaint_cli.play_runs(folders, picture, on_run=show, replace=options.replace)
    if options.json:
        print(json.dumps([one.as_json() for one in evaluated], indent=2))
    else:
        print_written([picture], "repaint compare --help")
