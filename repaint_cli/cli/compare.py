"""`repaint compare`."""

import json
from pathlib import Path
from typing import TYPE_CHECKING

from repaint_cli.cli.compare_options import CompareOptions
from repaint_cli.cli.compare_training import go_on, print_what_would_run, train
from repaint_cli.cli.option_rules import check_together, parsed_into
from repaint_cli.cli.option_values import parse_targets
from repaint_cli.errors import UsageError
from repaint_cli.files.commands import command

if TYPE_CHECKING:
    from repaint_cli.runs.against_itself import AgainstItself
    from repaint_cli.runs.compare import ComparedRuns, EvaluatedRun
    from repaint_cli.runs.comparison import Comparison


@parsed_into(CompareOptions)
def compare(options: CompareOptions) -> None:
    """Compare runs of a task, or train them first.

    By return, and by the iterations, steps and time to a target score, with intervals over seeds.

    Examples:
        repaint compare runs/reacher/* --report report
        repaint compare --task reacher --teacher reacher-gentle --jobs 2
    """
    targets = parse_targets(options.target)
    check_together(options)
    if options.dry_run:
        return print_what_would_run(options)
    folders = list(options.folders or [])
    if options.aa:
        _check_one(options, folders)
    if options.task or options.resume:
        _check_places(options)
        folders += train(options, folders) if options.task else go_on(options, folders)
    if options.trajectories:
        return _play(options, folders)
    if options.aa:
        return _compare_with_itself(options, folders)
    return _compare(options, folders, targets)


def _check_one(options: CompareOptions, folders: list[Path]) -> None:
    """Check that there will be one run for --aa.

    Raises:
        UsageError: there are several, or none.
    """
    from repaint_cli.runs.kept_records import kept_records

    kept = len(kept_records(options.resume)) if options.resume else 0
    if len(folders) + bool(options.task) + kept != 1:
        n_runs = len(folders) + kept
        raise UsageError(
            f"expected one RUN with --aa, or --task without RUN; found {n_runs} "
            f"{'run' if n_runs == 1 else 'runs'}{' and --task' * bool(options.task)}"
        )


def _check_places(options: CompareOptions) -> None:
    """Check, before anything is trained, that what will be written replaces no file of others."""
    from repaint_cli.runs import against_itself, compare

    where = options.output, options.report
    if options.aa:
        against_itself.check_places(*where, replace=options.replace)
    else:
        compare.check_places(*where, paths=options.trajectories, replace=options.replace)


def _compare(options: CompareOptions, folders: list[Path], targets: tuple[float, ...]) -> None:
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
        target=targets or None,
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


def _compare_with_itself(options: CompareOptions, folders: list[Path]) -> None:
    """Compare one run with itself; print the numbers before anything is written."""
    from repaint_cli.cli.comparison_table import print_against_itself
    from repaint_cli.cli.printing import print_written
    from repaint_cli.runs.against_itself import compare_with_itself

    def show(alike: "AgainstItself") -> None:
        if options.json:
            print(json.dumps(alike.as_json(), indent=2))
        else:
            print_against_itself(alike)

    where = options.output, options.report
    _, written = compare_with_itself(folders[0], *where, show, replace=options.replace)
    if not options.json:
        following = (
            "repaint open {}" if options.report else "repaint compare --aa {} --report report"
        )
        print_written(written, command(following, options.report or folders[0]))


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
