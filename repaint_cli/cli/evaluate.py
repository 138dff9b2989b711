"""`repaint eval`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

from repaint_cli.cli import completion
from repaint_cli.cli.option_rules import parsed_into, settings_of
from repaint_cli.cli.option_values import seed_list
from repaint_cli.cli.options import HOW, WRITE, Device, Set, argument, option
from repaint_cli.files.commands import command

if TYPE_CHECKING:
    from repaint_cli.envs.episodes import Episodes
    from repaint_cli.runs.evaluate import Evaluation
    from repaint_cli.runs.find_policies import Policies
    from repaint_cli.tasks.card import TaskCard

PLAYED = "What to play"


class EvaluateOptions(NamedTuple):
    """The options of `repaint eval`, in the order of its help."""

    policy: Annotated[
        str | None,
        argument(
            "POLICY",
            "A run's folder, a teacher or its file. Default: the newest run.",
            PLAYED,
            autocompletion=completion.policies,
        ),
    ] = None
    task: Annotated[
        str | None,
        option(
            PLAYED,
            "TASK",
            "Play this task instead of the one that it was trained on.",
            autocompletion=completion.tasks,
        ),
    ] = None
    episodes: Annotated[
        int | None,
        option(HOW, "INT", "How many episodes to play. Default: the card's."),
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
    ] = None
    race: Annotated[
        bool,
        option(
            HOW,
            None,
            "Race: laps from the start line, with penalties and resets; see eval.laps. Only for "
            "racing tasks.",
            "--race",
        ),
    ] = False
    set: Set = None
    device: Device = "cpu"
    render_offscreen: Annotated[
        bool,
        option(WRITE, None, "Film the first episodes; this needs no screen.", "--render-offscreen"),
    ] = False
    video_episodes: Annotated[
        int | None,
        option(WRITE, "INT", "How many episodes to film. Default: 5; in racing 1 on each track."),
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
        str | None,
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
    import repaint_cli
    from repaint_cli.cli.console import literal
    from repaint_cli.cli.episode_table import table
    from repaint_cli.cli.live import live
    from repaint_cli.cli.namesakes import print_notes
    from repaint_cli.cli.printing import out
    from repaint_cli.runs.evaluate import check_filmed

    def show(policies: "Policies", episodes: "Episodes") -> None:
        shown = table(policies.name, policies.seeds, policies.card.env, episodes)
        out.print(shown, soft_wrap=False)
        if (precision := policies.network.net.precision) != "float32":
            out.print(f"played in {precision} (net.precision)")
        if paid := _paid(policies.card, episodes):
            out.print(literal(paid))

    check_filmed(options.video_episodes)
    print_notes(options.policy or "")
    with live(out):
        evaluation = repaint_cli.evaluate(
            options.policy,
            task=options.task,
            episodes=options.episodes,
            noise=options.noise,
            race=options.race,
            settings=settings_of(options),
            seed=None if options.seed is None else seed_list(options.seed, 1)[0],
            keep_observations=options.render_offscreen,
            log_folder=options.simtrace,
            colour=options.colour or "",
            device=options.device,
            on_episodes=show,
        )
        _film(options, evaluation)


def _film(options: EvaluateOptions, evaluation: "Evaluation") -> None:
    """Film episodes if asked for; print what was written, and the next command."""
    from repaint_cli.cli.printing import print_written
    from repaint_cli.errors import RenderError, StoreError

    written, following = list(evaluation.written), _next_command(options, evaluation)
    if options.render_offscreen:
        try:
            written.append(evaluation.film(options.video_episodes))
        except (RenderError, StoreError):
            print_written(written, following)
            raise
    print_written(written, following)


def _paid(card: "TaskCard", episodes: "Episodes") -> str | None:
    """Return what a reward function paid itself, where the return is a multiple of it."""
    from repaint_cli.tasks.task import FUNCTION

    if card.reward_code is None or (scale := card.reward[FUNCTION]) == 1:
        return None
    paid = f"{episodes.terms.mean():.4g}"
    return f"{card.reward_code.name} paid {paid} an episode; the return is {scale:g} × that"


def _next_command(options: EvaluateOptions, evaluation: "Evaluation") -> str:
    """Return the next command worth typing."""
    from repaint_cli.zoo.view_names import split

    policies = evaluation.policies
    if policies.teacher is None:
        run = policies.run_folder
        if policies.folder == run or options.render_offscreen:
            return command("repaint open {}", run)  # its page shows its own film and pictures
        sets = options.set or []
        form = "repaint eval {}" + " --set {}" * len(sets) + " --race" * options.race
        return command(f"{form} --render-offscreen", run, *sets)
    name = split(options.policy or "")[0]
    if policies.teacher.task.reward_code:
        return command("repaint similarity {}", str(options.task))
    others = [options.task] if options.task else []
    return command("repaint similarity" + " {}" * (1 + len(others)), name, *others)
