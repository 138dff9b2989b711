"""`repaint eval`."""

from pathlib import Path
from typing import Annotated, Literal, NamedTuple

from repaint_cli.cli.option_rules import Rule, parsed_into, settings_of
from repaint_cli.cli.options import HOW, WRITE, Set, argument, option

PLAYED = "What to play"


class EvaluateOptions(NamedTuple):
    """The options of `repaint eval`, in the order of its help."""

    policy: Annotated[
        str | None,
        argument(
            "POLICY", "A run's folder, a teacher or its file. Default: the newest run.", PLAYED
        ),
    ] = None
    task: Annotated[
        str | None,
        option(PLAYED, "TASK", "Play this task instead of the one that it was trained on."),
    ] = None
    episodes: Annotated[
        int | None,
        option(HOW, "INT", "How many episodes to play. Default: the card's."),
        Rule("eval.episodes"),
    ] = None
    seed: Annotated[
        int | None, option(HOW, "INT", "The seed of the episodes. Default: the policy's own.")
    ] = None
    noise: Annotated[
        str | None,
        option(
            HOW,
            "NAME",
            "Noise on what the car sees and does: none or paper. Only for racing tasks.",
        ),
        Rule("eval.noise"),
    ] = None
    set: Set = None
    render_offscreen: Annotated[
        bool,
        option(WRITE, None, "Film the first episodes; this needs no screen.", "--render-offscreen"),
    ] = False
    video_episodes: Annotated[
        int | None, option(WRITE, "INT", "How many episodes to film. Default: 5, or 1 of a race.")
    ] = None
    simtrace: Annotated[
        Path | None,
        option(
            WRITE,
            "FOLDER",
            "Also log every step in DeepRacer's layout in this folder. Only for racing tasks.",
        ),
    ] = None
    colour: Annotated[
        Literal["speed", "reward"] | None,
        option(
            WRITE,
            "NAME",
            "Colour the laps by speed or reward. Default: speed. Only for racing tasks.",
        ),
    ] = None


@parsed_into(EvaluateOptions)
def evaluate(options: EvaluateOptions) -> None:
    """Play a policy, say how it did, draw it, film it.

    It takes its most likely actions.

    Examples:
        repaint eval --render-offscreen
        repaint eval racer-inner --task racer-outer --episodes 20
    """
    from repaint_cli.cli.examine import adjusted, check_options, examine, subject

    policies = subject(options.policy, options.task, Path("runs"))
    policies = adjusted(policies, settings_of(options), options.set)
    check_options(
        policies.task, options.video_episodes, options.noise, options.simtrace, options.colour
    )
    examine(
        policies,
        options.seed,
        options.video_episodes,
        options.render_offscreen,
        options.simtrace,
        options.colour or "",
    )
