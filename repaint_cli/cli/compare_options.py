"""The options of `repaint compare`."""

from pathlib import Path
from typing import Annotated, NamedTuple

from repaint_cli.cli import completion
from repaint_cli.cli.engine_options import CpusPerRun, EngineName, GpusPerRun, Jobs, Retries
from repaint_cli.cli.option_rules import Condition, Rule
from repaint_cli.cli.options import WRITE, AsJson, argument, option
from repaint_cli.engines.options import LOCAL, RETRIES

DEFAULT_METHODS = "scratch,kickstart,instance,repaint"
"""What is trained where --methods is absent: the paper's table 1."""

COMPARED = "What to compare"
TRAINED = "What to train first"

WITH_TASK = Condition(lambda options: options.task, "{option} is for --task; leave it out")
WITHOUT_TASK = Condition(
    lambda options: not options.task, "runs go on as they began: leave out --task beside {option}"
)
TRAINING = Condition(
    lambda options: options.task or options.resume,
    "{option} is for --task or --resume; leave it out",
)
OF_RETURNS = Condition(
    lambda options: not options.trajectories, "{option} is for figures of returns; leave it out"
)
OF_SEVERAL = Condition(
    lambda options: not options.trajectories and not options.aa,
    "{option} is for figures of returns of several runs; leave it out",
)
WITHOUT_REPORT = Condition(
    lambda options: not options.report,
    "{option} is for a single picture, in place of --report; leave it out",
)


class CompareOptions(NamedTuple):
    """The options of `repaint compare`, in the order in which they are checked."""

    folders: Annotated[
        list[Path] | None,
        argument(
            "RUN",
            "Runs' folders, all of one task unless --trajectories.",
            COMPARED,
            autocompletion=completion.runs,
        ),
    ] = None
    task: Annotated[
        str | None,
        option(
            TRAINED,
            "TASK",
            "Train --methods on this task, then compare them too.",
            autocompletion=completion.tasks,
        ),
    ] = None
    teacher: Annotated[
        list[str] | None,
        option(
            TRAINED,
            "TEACHER",
            "A teacher's name or file; again for several.",
            autocompletion=completion.teachers,
        ),
        Rule(options=WITH_TASK),
    ] = None
    methods: Annotated[
        str | None,
        option(TRAINED, "METHOD,...", f"Methods, with commas between. Default: {DEFAULT_METHODS}."),
        Rule(options=WITH_TASK),
    ] = None
    preset: Annotated[
        str | None,
        option(TRAINED, "NAME", "paper: the paper's numbers; coach: and its framework's choices."),
        Rule(options=WITH_TASK),
    ] = None
    seeds: Annotated[
        int | None,
        option(
            TRAINED,
            "INT",
            "How many seeds of each method. Default: 10, or 3 if an iteration takes over a second; "
            "twice that with --aa.",
        ),
        Rule(options=WITH_TASK),
    ] = None
    seed: Annotated[
        int | None,
        option(TRAINED, "INT", "The first seed; the others follow it. Default: 0."),
        Rule(options=WITH_TASK),
    ] = None
    iterations: Annotated[
        int | None,
        option(TRAINED, "INT", "Iterations of training. Default: the card's."),
        Rule("ppo.n_iterations", options=WITH_TASK),
    ] = None
    set: Annotated[
        list[str] | None,
        option(TRAINED, "SECTION.KEY=VALUE", "A setting of the card; again for several."),
        Rule(list, options=WITH_TASK),
    ] = None
    into: Annotated[
        Path | None,
        option(
            TRAINED,
            "FOLDER",
            "The runs' folder. What the same command began there goes on. Default: "
            "runs/TASK/compare-…",
        ),
        Rule(options=WITH_TASK),
    ] = None
    resume: Annotated[
        Path | None,
        option(
            TRAINED,
            "FOLDER",
            "Go on with what an earlier command trained there, as it began; then compare.",
        ),
        Rule(options=WITHOUT_TASK),
    ] = None
    engine: Annotated[EngineName, Rule(options=TRAINING)] = LOCAL
    jobs: Annotated[Jobs, Rule(options=TRAINING)] = None
    cpus_per_run: Annotated[CpusPerRun, Rule(options=TRAINING)] = None
    gpus_per_run: Annotated[GpusPerRun, Rule(options=TRAINING)] = None
    retries: Annotated[Retries, Rule(options=TRAINING)] = RETRIES
    dry_run: Annotated[
        bool,
        option(TRAINED, None, "Print what would run, and how long it takes.", "--dry-run"),
        Rule(options=WITH_TASK),
    ] = False
    target: Annotated[
        str,
        option(
            COMPARED,
            "FLOAT,...",
            "Returns to reach; auto is shares of what the reference converged to, and its best "
            "mean.",
        ),
        Rule(options=OF_SEVERAL),
    ] = "auto"
    reference: Annotated[
        str | None,
        option(COMPARED, "RUN", "The run or method to compare others with. Default: scratch."),
        Rule(options=OF_SEVERAL),
    ] = None
    aa: Annotated[
        bool,
        option(
            COMPARED,
            None,
            "Compare one run with itself: what its seeds show where there is no difference.",
            "--aa",
        ),
        Rule(options=OF_RETURNS),
    ] = False
    report: Annotated[
        Path | None,
        option(WRITE, "FOLDER", "A folder for figures, tables and a page that explains them."),
        Rule(options=OF_RETURNS),
    ] = None
    output: Annotated[
        Path | None,
        option(WRITE, "FILE", "The picture. Default: compare.png."),
        Rule(options=WITHOUT_REPORT),
    ] = None
    replace: Annotated[
        bool, option(WRITE, None, "Replace files that repaint did not write.", "--replace")
    ] = False
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
