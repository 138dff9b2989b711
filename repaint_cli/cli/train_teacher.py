"""`repaint train-teacher`."""

from typing import Annotated

import typer

from repaint_cli.cli import options


def train_teacher(
    context: typer.Context,
    task: options.TaskUnlessResumed = None,
    name: Annotated[
        str | None, typer.Option(help="The teacher's name; default: the task's.")
    ] = None,
    replace: Annotated[
        bool, typer.Option("--replace", help="Replace a teacher of this name in your zoo.")
    ] = False,
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
    """Train a teacher and put it into your zoo.

    It learns from scratch; its best evaluated policy is kept.
    """
    from repaint_cli.cli.session import carry_out, new_folder, new_teacher_name, plan_again
    from repaint_cli.runs.plan import Plan
    from repaint_cli.tasks.card_files import read_task

    if resume:
        options.check_alone(context, "iterations", "name", "replace", "tensorboard")
        plan = plan_again(resume, iterations, name, replace, for_teacher=True)
        return carry_out(plan, tensorboard, resume=True)
    card = options.customize(
        read_task(options.task_named(task)),
        settings,
        preset,
        ppo__n_iterations=iterations,
        eval__episodes=eval_episodes,
    )
    name = new_teacher_name(name or card.name, replace)
    folder = new_folder(run, card.name, "scratch")
    plan = Plan(
        card, "scratch", options.seed_list(seed, seeds), folder,
        teacher_name=name, replace=replace, keep=keep,
    )  # fmt: skip
    carry_out(plan, tensorboard)
