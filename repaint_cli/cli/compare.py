"""`repaint compare`."""

from pathlib import Path
from typing import Annotated

import typer


def compare(
    folders: Annotated[
        list[Path], typer.Argument(help="Runs' folders; without --trajectories all on one task.")
    ],
    output: Annotated[Path | None, typer.Option(help="The picture; default: compare.png.")] = None,
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
    """Compare runs on one task, side by side.

    By return over time, its area, and iterations to scratch's best.
    """
    from repaint_cli.cli import side_by_side
    from repaint_cli.cli.session import say_written
    from repaint_cli.report.pictures import draw_curves

    if trajectories:
        return side_by_side.play(folders, output or Path("compare-trajectories.png"), as_json)
    runs = side_by_side.read_runs(folders)
    side_by_side.print_comparison(runs, as_json)
    task = next(iter(runs.values())).task.name
    picture = output or Path("compare.png")
    draw_curves(runs, picture, title=f"{task}: {', '.join(runs)}")
    if not as_json:
        say_written([picture], "repaint transfer --help")
    return None
