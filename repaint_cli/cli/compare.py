"""`repaint compare`."""

from pathlib import Path
from typing import Annotated

import typer

from repaint_cli.cli import options


def compare(
    folders: Annotated[
        list[Path] | None,
        typer.Argument(help="Runs' folders; without --trajectories all on one task."),
    ] = None,
    target: Annotated[
        str, typer.Option(help="The score to reach; auto: the reference's best mean.")
    ] = "auto",
    reference: Annotated[
        str, typer.Option(help="The run or method that others are compared with.")
    ] = "scratch",
    task: Annotated[
        str | None, typer.Option(help="Train --methods on this task first, then compare them.")
    ] = None,
    teacher: Annotated[
        list[str] | None, typer.Option(help="With --task: a teacher; again for several.")
    ] = None,
    methods: Annotated[
        str, typer.Option(help="With --task: which, with commas between.")
    ] = "scratch,kickstart,instance,repaint",
    seeds: options.Seeds = 3,
    seed: options.Seed = 0,
    iterations: options.Iterations = None,
    jobs: Annotated[int, typer.Option(help="With --task: how many runs at a time.")] = 1,
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

    named = list(folders or [])
    if task:
        runs = options.seed_list(seed, seeds)
        named += contest.train_all(task, methods, teacher, runs, iterations, settings, jobs)
    if trajectories:
        return side_by_side.play(named, output or Path("compare-trajectories.png"), as_json)
    return side_by_side.compare(named, reference, target, output, report, as_json)
