"""`repaint compare`."""

from pathlib import Path
from typing import Annotated

import typer

from repaint_cli.cli import options

DEFAULT_METHODS = "scratch,kickstart,instance,repaint"
"""What is trained where --methods does not say: the paper's table 1."""


def compare(
    folders: Annotated[
        list[Path] | None,
        typer.Argument(help="Runs' folders; without --trajectories all on one task."),
    ] = None,
    target: Annotated[
        str, typer.Option(help="The score to reach; auto: the reference's best mean.")
    ] = "auto",
    reference: Annotated[
        str | None,
        typer.Option(help="The run or method that others are compared with; default: scratch."),
    ] = None,
    task: Annotated[
        str | None, typer.Option(help="Train --methods on this task first, then compare them.")
    ] = None,
    teacher: Annotated[
        list[str] | None, typer.Option(help="With --task: a teacher; again for several.")
    ] = None,
    methods: Annotated[
        str | None,
        typer.Option(help=f"With --task: which, with commas between; default: {DEFAULT_METHODS}."),
    ] = None,
    seeds: Annotated[
        int | None, typer.Option(help="With --task: how many seeds each; default: 3.")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="With --task: the first seed; default: 0.")
    ] = None,
    iterations: options.Iterations = None,
    jobs: Annotated[
        int | None, typer.Option(help="With --task: how many runs at a time; default: 1.")
    ] = None,
    settings: options.Set = None,
    output: Annotated[Path | None, typer.Option(help="The picture; default: compare.png.")] = None,
    report: Annotated[
        Path | None,
        typer.Option(help="A folder for figures, tables and a page that explains them."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    trajectories: Annotated[
        bool,
        typer.Option(
            "--trajectories",
            help="Play the runs' last policies instead, 20 episodes each, and draw their paths; "
            "races may be of several tasks on one track.",
        ),
    ] = False,
) -> None:
    """Compare runs on one task, or train several methods and compare them.

    By iterations, steps and time to a target, and by return: with intervals over seeds.
    """
    from repaint_cli.cli import contest, side_by_side

    named, goal = list(folders or []), side_by_side.target_of(target)
    if not task:
        options.refuse(
            "--task", teacher=teacher, methods=methods, seeds=seeds, seed=seed,
            iterations=iterations, jobs=jobs, set=settings,
        )  # fmt: skip
    if trajectories:
        options.refuse("figures of returns", target=goal, reference=reference, report=report)
    if report:
        options.refuse("a single picture, in place of --report", output=output)
    if task:
        chosen = DEFAULT_METHODS if methods is None else methods
        side_by_side.check_reference(reference, named, chosen)
        runs = options.seed_list(seed or 0, 3 if seeds is None else seeds)
        named += contest.train_all(
            task, chosen, teacher, runs, iterations, settings, 1 if jobs is None else jobs
        )
    if trajectories:
        return side_by_side.play(named, output or Path("compare-trajectories.png"), as_json)
    return side_by_side.compare(named, reference or "scratch", goal, output, report, as_json)
