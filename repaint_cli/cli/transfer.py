"""`repaint transfer`."""

from typing import Annotated

import typer

from repaint_cli.cli import options
from repaint_cli.methods import METHODS

METHOD_HELP = "; ".join(f"{name}: {method.summary}" for name, method in METHODS.items()) + "."


def transfer(
    task: options.Task,
    teacher: Annotated[
        str | None, typer.Option(help="A teacher's name (repaint zoo list) or file.")
    ] = None,
    method: Annotated[str, typer.Option(help=METHOD_HELP)] = "repaint",
    ratio: Annotated[
        str | None, typer.Option(help="R:I, R representation then I instance iterations.")
    ] = None,
    beta: Annotated[float | None, typer.Option(help="β₀, weight of the cross-entropy.")] = None,
    beta_decay: Annotated[float | None, typer.Option(help="β's factor per iteration.")] = None,
    threshold: Annotated[
        float | None, typer.Option(help="ζ: keep teacher samples with advantage ≥ ζ.")
    ] = None,
    transfer_iterations: Annotated[
        int | None, typer.Option(help="K, the last iteration with the teacher.")
    ] = None,
    iterations: options.Iterations = None,
    seeds: options.Seeds = 1,
    seed: options.Seed = 0,
    eval_episodes: options.EvalEpisodes = None,
    settings: options.Set = None,
    run: options.RunFolder = None,
    tensorboard: options.TensorBoard = False,
) -> None:
    """Transfer a teacher to a new task.

    With REPAINT, or one of its rivals.
    """
    from repaint_cli.cards import read_task
    from repaint_cli.cli.session import carry_out, find_teacher, new_folder
    from repaint_cli.runs import Plan

    options.check_method(
        method, ratio=ratio, beta=beta, beta_decay=beta_decay, threshold=threshold,
        transfer_iterations=transfer_iterations,
    )  # fmt: skip
    representation, instance = options.parse_ratio(ratio)
    card = options.customize(
        read_task(task), settings,
        ppo__n_iterations=iterations, eval__episodes=eval_episodes, select__threshold=threshold,
        transfer__kickstart_coef=beta, transfer__kickstart_decay=beta_decay,
        transfer__representation=representation, transfer__instance=instance,
        transfer__iterations=transfer_iterations,
    )  # fmt: skip
    path = find_teacher(teacher, method)
    folder = new_folder(run, card.name, f"{method}-{path.stem}" if path else method)
    plan = Plan(card, method, options.seed_list(seed, seeds), folder, path)
    carry_out(plan, tensorboard)
