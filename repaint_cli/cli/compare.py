"""`repaint compare`."""

from pathlib import Path
from typing import Annotated

import typer


def compare(
    folders: Annotated[list[Path], typer.Argument(help="Runs' folders, all on one task.")],
    output: Annotated[Path, typer.Option(help="The picture.")] = Path("compare.png"),
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Compare runs on one task: return over time, its area, iterations to scratch's best."""
    from repaint_cli.cli.session import say_written
    from repaint_cli.cli.side_by_side import print_comparison, read_runs
    from repaint_cli.report.pictures import draw_curves

    runs = read_runs(folders)
    print_comparison(runs, as_json)
    task = next(iter(runs.values())).task.name
    draw_curves(runs, output, title=f"{task}: {', '.join(runs)}")
    if not as_json:
        say_written([output], "repaint transfer --help")
