"""`repaint tasks replay`."""

from pathlib import Path
from typing import Annotated

from repaint_cli.cli import completion
from repaint_cli.cli.options import HOW, WRITE, AsJson, argument, option


def replay(
    logs: Annotated[
        list[Path],
        argument(
            "LOGS", "Simtraces (.csv), texts with SIM_TRACE_LOG lines, or folders such as a run's."
        ),
    ],
    task: Annotated[
        str,
        option(
            HOW,
            "TASK",
            "The card whose reward pays, and on whose track the logs were driven.",
            autocompletion=completion.tasks,
        ),
    ],
    plot: Annotated[
        Path | None,
        option(WRITE, "FILE", "The picture, .png or .svg. Default: TASK-replay.png."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Pay logged laps by another reward, and compare it with what was logged.

    The logs are DeepRacer's or those of a run. Nothing is driven, and nothing learned.

    Examples:
        repaint tasks replay my-logs --task my-task.toml
        repaint tasks replay 12-iteration.csv --task my-task.toml --plot new.png
    """
    from repaint_cli.cli.printing import print_written
    from repaint_cli.cli.replay_table import print_json, print_replay
    from repaint_cli.errors import CardError
    from repaint_cli.files.commands import command
    from repaint_cli.report.replay import plot_replay
    from repaint_cli.tasks.card_files import read_task

    card = read_task(task)
    if card.env.logs is None:
        raise CardError(f"expected --task with a racing task, found '{card.name}'")
    picture = plot or Path(f"{card.name}-replay.png")
    _check_picture(picture)
    code = (card.reward_code.name, card.reward_code.source) if card.reward_code else None
    replayed = card.env.logs.replay(logs, card.reward, code)
    payer = code[0] if code else f"the reward of {card.name}"
    if as_json:
        print_json(replayed)
    else:
        print_replay(payer, replayed)
    n = f"{len(replayed.episodes):,} logged episode{'s' * (len(replayed.episodes) != 1)}"
    plot_replay(*replayed.returns, replayed.whole, picture, f"{n}, paid by {payer}")
    if not as_json:
        print_written([picture], command("repaint train-teacher --task {}", task))


def _check_picture(path: Path) -> None:
    """Check that a picture may be written there.

    Raises:
        UsageError: it is of another format.
        StoreError: a file of somebody else's is there.
    """
    from repaint_cli.errors import UsageError
    from repaint_cli.files.foreign import check_replaceable

    if path.suffix not in (".png", ".svg"):
        raise UsageError(f"expected --plot with a name that ends in .png or .svg, found '{path}'")
    check_replaceable([path], advice="name another with --plot")
