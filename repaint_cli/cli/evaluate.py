"""`repaint eval`."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from repaint_cli.cli import options


def evaluate(
    what: Annotated[
        str | None,
        typer.Argument(help="A run's folder, a teacher, or its file; none: the newest run."),
    ] = None,
    task: Annotated[
        str | None, typer.Option(help="Play this task instead of the one it was trained on.")
    ] = None,
    episodes: options.EvalEpisodes = None,
    noise: Annotated[
        str | None,
        typer.Option(help="Small noise on what it sees and does: none or paper; racer only."),
    ] = None,
    render_offscreen: Annotated[
        bool, typer.Option("--render-offscreen", help="Film the first episodes, without a screen.")
    ] = False,
    video_episodes: Annotated[int | None, typer.Option(help="How many episodes to film.")] = None,
    simtrace: Annotated[
        Path | None,
        typer.Option(help="Also log every step in DeepRacer's layout, in this folder; racer only."),
    ] = None,
    colour: Annotated[
        Literal["speed", "reward"] | None,
        typer.Option(help="What colours the laps that are drawn; default: speed."),
    ] = None,
    settings: options.Set = None,
    seed: Annotated[
        int | None, typer.Option(help="Of the episodes; default: the policy's own.")
    ] = None,
) -> None:
    """Play a policy, say how it did, draw it, film it.

    It takes its most likely actions.
    """
    from repaint_cli.cli.examine import adjusted, check_options, examine, subject

    chosen = subject(what, task, Path("runs"))
    chosen = adjusted(chosen, settings, episodes, noise)
    check_options(chosen.task, video_episodes, noise, simtrace, colour)
    examine(chosen, seed, video_episodes, render_offscreen, simtrace, colour or "")
