"""`repaint train-teacher`."""

from typing import Annotated, NamedTuple

import typer

from repaint_cli.cli.option_rules import Rule, check_resume, parsed_into, settings_of
from repaint_cli.cli.option_values import seed_list, task_named
from repaint_cli.cli.options import (
    WHERE,
    EvalEpisodes,
    Iterations,
    Keep,
    Preset,
    Replace,
    Resume,
    RunFolder,
    Seed,
    Seeds,
    Set,
    Task,
    TensorBoard,
    option,
)


class TrainTeacherOptions(NamedTuple):
    """The options of `repaint train-teacher`, in the order of its help."""

    context: typer.Context
    task: Task = None
    preset: Preset = None
    iterations: Iterations = None
    seeds: Seeds = 1
    seed: Seed = 0
    eval_episodes: EvalEpisodes = None
    set: Set = None  # behind all that sets something else: it has the last word
    resume: Resume = None
    name: Annotated[
        str | None,
        option(WHERE, "NAME", "The teacher's name in your zoo. Default: the task's."),
        Rule(resumable=True),
    ] = None
    replace: Replace = False
    run: RunFolder = None
    keep: Keep = 1
    tensorboard: TensorBoard = False


@parsed_into(TrainTeacherOptions)
def train_teacher(options: TrainTeacherOptions) -> None:
    """Train a teacher and put it into your zoo.

    It learns from scratch; its best evaluated policy is kept.

    Examples:
        repaint train-teacher --task racer-inner
        repaint train-teacher --task my-task.toml --name mine --seeds 3
    """
    from repaint_cli.cli.session import carry_out, new_folder, new_teacher_name, plan_again
    from repaint_cli.runs.plan import Plan
    from repaint_cli.tasks.card_files import read_task

    if options.resume:
        check_resume(options, options.context)
        plan = plan_again(
            options.resume, options.iterations, options.name, options.replace, for_teacher=True
        )
        return carry_out(plan, options.tensorboard, resume=True)
    card = read_task(task_named(options.task)).with_settings(settings_of(options))
    name = new_teacher_name(options.name or card.name, options.replace)
    plan = Plan(
        card,
        "scratch",
        seed_list(options.seed, options.seeds),
        new_folder(options.run, card.name, "scratch"),
        teacher_name=name,
        replace=options.replace,
        keep=options.keep,
    )
    carry_out(plan, options.tensorboard)
