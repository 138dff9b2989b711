"""`repaint transfer`."""

from typing import Annotated

import typer

from repaint_cli.cli import options
from repaint_cli.tasks.methods import METHODS

AS_LONG_AS_IT_GIVES = 10**6
"""K where the end of the transfer is measured."""

METHOD_HELP = "; ".join(f"{name}: {method.summary}" for name, method in METHODS.items()) + "."


def transfer(
    context: typer.Context,
    task: options.TaskUnlessResumed = None,
    teacher: Annotated[
        list[str] | None,
        typer.Option(help="A teacher's name (repaint zoo list) or file; again for several."),
    ] = None,
    method: Annotated[str | None, typer.Option(help=f"{METHOD_HELP} Default: repaint.")] = None,
    algorithm: Annotated[
        str, typer.Option(help="ppo; or q-learning, with --method instance (default) or scratch.")
    ] = "ppo",
    ratio: Annotated[
        str | None, typer.Option(help="R:I, R representation then I instance iterations; or auto.")
    ] = None,
    beta: Annotated[
        str | None,
        typer.Option(help="β₀, weight of the cross-entropy; 0.2,0.1 for two teachers; or auto."),
    ] = None,
    beta_decay: Annotated[float | None, typer.Option(help="β's factor per iteration.")] = None,
    select: Annotated[
        str | None,
        typer.Option(help="Keep teacher samples by zeta, abs, top, per, rbt, or all of them."),
    ] = None,
    threshold: Annotated[
        str | None, typer.Option(help="ζ: keep teacher samples with advantage ≥ ζ; or auto.")
    ] = None,
    auto: Annotated[
        bool,
        typer.Option("--auto", help="β, ζ, the ratio and the end of the transfer as measured."),
    ] = False,
    instances_from: Annotated[
        list[str] | None,
        typer.Option(help="Of several teachers, one whose own samples are used; default: all."),
    ] = None,
    objective: Annotated[
        str | None, typer.Option(help="clipped (PPO), a2c, trpo or reinforce.")
    ] = None,
    transfer_iterations: Annotated[
        int | None, typer.Option(help="K, the last iteration with the teacher.")
    ] = None,
    iterations: options.Iterations = None,
    seeds: options.Seeds = 1,
    seed: options.Seed = 0,
    eval_episodes: options.EvalEpisodes = None,
    preset: options.Preset = None,
    settings: options.Set = None,
    run: options.RunFolder = None,
    keep: options.Keep = 1,
    resume: options.Resume = None,
    tensorboard: options.TensorBoard = False,
) -> None:
    """Transfer a teacher to a new task.

    With REPAINT, or one of its rivals.
    """
    from repaint_cli.cli.session import (
        carry_out,
        find_acting,
        find_teachers,
        new_folder,
        plan_again,
    )
    from repaint_cli.runs.plan import Plan
    from repaint_cli.tasks.card_files import read_task

    if resume:
        options.check_alone(context, "iterations", "tensorboard")
        return carry_out(plan_again(resume, iterations), tensorboard, resume=True)
    method = options.method_for(algorithm, method)
    by_q = algorithm == "q-learning"
    options.check_method(
        method, algorithm, auto=auto or None, ratio=ratio, beta=beta, beta_decay=beta_decay,
        select=select, objective=objective, threshold=threshold,
        instances_from=instances_from or None, transfer_iterations=transfer_iterations,
        preset=preset,
    )  # fmt: skip
    if auto:
        ratio, beta, threshold = (word or "auto" for word in (ratio, beta, threshold))
        if transfer_iterations is None:
            transfer_iterations = AS_LONG_AS_IT_GIVES
    card = options.customize(
        read_task(options.task_named(task)), settings, preset,
        ppo__n_iterations=iterations, ppo__objective=objective,
        ppo__n_epochs=options.epochs_of(objective), eval__episodes=eval_episodes,
        q_learning__threshold=threshold if by_q else None,
        **options.given_by(ratio, beta, select, None if by_q else threshold),
        transfer__kickstart_decay=beta_decay,
        transfer__iterations=transfer_iterations,
    )  # fmt: skip
    if not by_q:
        decay = None if beta_decay is None else str(beta_decay)
        options.check_card(card, threshold=threshold, beta=beta, beta_decay=decay)
    teachers = find_teachers(teacher, method)
    parts = [algorithm] * by_q + [method, *(path.stem for path in teachers)]
    folder = new_folder(run, card.name, "-".join(parts))
    acting = find_acting(instances_from, teachers)
    plan = Plan(
        card, method, options.seed_list(seed, seeds), folder, teachers, acting, algorithm, keep=keep
    )
    carry_out(plan, tensorboard)
