"""`repaint compare`."""

from pathlib import Path

from repaint_cli.cli.compare_options import METHODS, CompareOptions
from repaint_cli.cli.option_rules import check_together, parsed_into, settings_of
from repaint_cli.cli.option_values import parse_methods, parse_target, seed_list


@parsed_into(CompareOptions)
def compare(options: CompareOptions) -> None:
    """Compare runs of a task, or train them first.

    By return, and by the iterations, steps and time to a target score, with intervals over seeds.

    Examples:
        repaint compare runs/reacher/* --report report
        repaint compare --task reacher --teacher reacher-gentle --jobs 2
    """
    from repaint_cli.cli import contest, side_by_side
    from repaint_cli.tasks.card_files import read_task

    target = parse_target(options.target)
    check_together(options)
    folders = list(options.folders or [])
    if options.task:
        methods = METHODS if options.methods is None else options.methods
        side_by_side.check_reference(options.reference, folders, methods)
        seeds = seed_list(options.seed or 0, 3 if options.seeds is None else options.seeds)
        jobs = 1 if options.jobs is None else options.jobs
        names = parse_methods(methods, jobs)
        card = read_task(options.task).with_settings(settings_of(options))
        folders += contest.train_all(card, names, options.teacher, seeds, jobs)
    if options.trajectories:
        picture = options.output or Path("compare-trajectories.png")
        return side_by_side.play(folders, picture, options.json)
    return side_by_side.compare(
        folders,
        options.reference or "scratch",
        target,
        options.output,
        options.report,
        options.json,
    )
