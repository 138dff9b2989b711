"""`repaint compare`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from repaint_cli.cli.option_rules import Condition, Rule, check_together, parsed_into, settings_of
from repaint_cli.cli.option_values import parse_methods, parse_target, seed_list
from repaint_cli.cli.options import WRITE, AsJson, argument, option

METHODS = "scratch,kickstart,instance,repaint"
"""What is trained where --methods is absent: the paper's table 1."""

COMPARED = "What to compare"
TRAINED = "What to train first"

WITH_TASK = Condition(lambda options: options.task, "{option} is for --task; leave it out")
OF_RETURNS = Condition(
    lambda options: not options.trajectories, "{option} is for figures of returns; leave it out"
)
WITHOUT_REPORT = Condition(
    lambda options: not options.report,
    "{option} is for a single picture, in place of --report; leave it out",
)


@dataclass(frozen=True)
class CompareOptions:
    """The options of `repaint compare`, in the order in which they are checked."""

    folders: Annotated[
        list[Path] | None,
        argument("RUN", "Runs' folders, all of one task unless --trajectories.", COMPARED),
    ] = None
    task: Annotated[
        str | None, option(TRAINED, "TASK", "Train --methods on this task, then compare them too.")
    ] = None
    teacher: Annotated[
        list[str] | None,
        option(TRAINED, "TEACHER", "A teacher's name or file; again for several."),
        Rule(beside=WITH_TASK),
    ] = None
    methods: Annotated[
        str | None,
        option(TRAINED, "METHOD,...", f"Methods, with commas between. Default: {METHODS}."),
        Rule(beside=WITH_TASK),
    ] = None
    seeds: Annotated[
        int | None,
        option(TRAINED, "INT", "How many seeds of each method. Default: 3."),
        Rule(beside=WITH_TASK),
    ] = None
    seed: Annotated[
        int | None,
        option(TRAINED, "INT", "The first seed; the others follow it. Default: 0."),
        Rule(beside=WITH_TASK),
    ] = None
    iterations: Annotated[
        int | None,
        option(TRAINED, "INT", "Iterations of training. Default: the card's."),
        Rule("ppo.n_iterations", beside=WITH_TASK),
    ] = None
    jobs: Annotated[
        int | None,
        option(TRAINED, "INT", "How many runs at a time. Default: 1."),
        Rule(beside=WITH_TASK),
    ] = None
    set: Annotated[
        list[str] | None,
        option(TRAINED, "SECTION.KEY=VALUE", "A setting of the card; again for several."),
        Rule(list, beside=WITH_TASK),
    ] = None
    target: Annotated[
        str,
        option(COMPARED, "FLOAT", "The score to reach; auto is the reference's best mean."),
        Rule(beside=OF_RETURNS),
    ] = "auto"
    reference: Annotated[
        str | None,
        option(COMPARED, "RUN", "The run or method to compare others with. Default: scratch."),
        Rule(beside=OF_RETURNS),
    ] = None
    report: Annotated[
        Path | None,
        option(WRITE, "FOLDER", "A folder for figures, tables and a page that explains them."),
        Rule(beside=OF_RETURNS),
    ] = None
    output: Annotated[
        Path | None,
        option(WRITE, "FILE", "The picture. Default: compare.png."),
        Rule(beside=WITHOUT_REPORT),
    ] = None
    json: AsJson = False
    trajectories: Annotated[
        bool,
        option(
            WRITE,
            None,
            "Play each run's last policy in 20 episodes and draw the paths instead; races may be "
            "of several tasks on one track.",
            "--trajectories",
        ),
    ] = False


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
