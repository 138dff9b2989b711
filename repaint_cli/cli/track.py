"""`repaint tasks track from-centre-line`."""

from pathlib import Path
from typing import Annotated

import typer

from repaint_cli.cli.help_page import OPTIONS, HelpPage
from repaint_cli.cli.options import argument, option

track = typer.Typer(no_args_is_help=True, help="Make a file of waypoints, a track.")


@track.command(cls=HelpPage)
def from_centre_line(
    file: Annotated[Path, argument("FILE", "Its points x, y in m: .csv, text, or .npy (N, 2).")],
    width: Annotated[float, option(OPTIONS, "M", "From border to border, m.")] = 0.76,
    output: Annotated[
        Path | None, option(OPTIONS, "FILE", "The new file. Default: FILE-track.npy.")
    ] = None,
) -> None:
    """Make a track of a centre line: its borders run at half the width.

    Ends that nearly meet are closed, and loops of borders in tight corners are cut.

    Examples:
        repaint tasks track from-centre-line my-line.csv --width 0.76
        repaint tasks track from-centre-line my-line.csv --output my-track.npy
    """
    from repaint_cli.cli.console import plain
    from repaint_cli.envs.racer.track.centre_line import write_track_around
    from repaint_cli.envs.racer.track.map import facts_of
    from repaint_cli.files.commands import command

    path = output or file.with_name(f"{file.stem}-track.npy")
    made, note = write_track_around(str(file), width, path)
    print(plain(f"wrote {path}: {facts_of(made)}"))
    if note:
        print(plain(f"note: {note}"))
    print(plain(f"next: {command('repaint tasks check {}', path)}"))
