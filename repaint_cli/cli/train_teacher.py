"""`repaint train-teacher`."""

from typing import Annotated, NamedTuple

import typer

from repaint_cli.cli.option_rules import Rule, check_resume, parsed_into, settings_of
from repaint_cli.cli.option_values import seed_list, task_named, trackers
from repaint_cli.cli.options import (
    WHERE,
    EvalEpisodes,
    Iterations,
    Keep,
    Preset,
    Replace,
    Resume,
    RunFolderOption,
    Seed,
    Seeds,
    Set,
    TaskOption,
    TensorBoard,
    Track,
    option,
)


class TrainTeacherOptions(NamedTuple):
    """The options of `repaint train-teacher`, in the order of its help."""

    context: typer.Context
    task: TaskOption = None
    preset: Preset = None
    iterations: Iterations = None
    seeds: Seeds = 1
    seed: Seed = 0
    eval_episodes: EvalEpisodes = None
    set: Set = None  # after all other settings: it overrides them
    resume: Resume = None
    name: Annotated[
        str | None,
        option(WHERE, "NAME", "The teacher's name in your zoo. Default: the task's."),
        Rule(resumable=True),
    ] = None
    replace: Replace = False
    run: RunFolderOption = None
    keep: Keep = 1
    track: Track = None
    tensorboard: TensorBoard = False


@parsed_into(TrainTeacherOptions)
def train_teacher(options: TrainTeacherOptions) -> None:
    """Train a teacher and put it into your zoo.

    It learns from scratch; its best evaluated policy is kept.

    Examples:
        repaint train-teacher --task racer-inner
        repaint train-teacher --task my-task.toml --name mine --seeds 3
    """
    import repaint_cli
    from repaint_cli.cli.screen import Screen

    if options.resume:
        check_resume(options, options.context)
        return Screen().run(
            repaint_cli.resume,
            options.resume,
            iterations=options.iterations,
            name=options.name,
            replace=options.replace,
            track=trackers(options.track, options.tensorboard),
            for_teacher=True,
        )
    card = repaint_cli.load_task(task_named(options.task)).with_settings(settings_of(options))
    return Screen().run(
        repaint_cli.train,
        card,
        seeds=seed_list(options.seed, options.seeds),
        name=options.name,
        replace=options.replace,
        folder=options.run,
        keep=options.keep,
        track=trackers(options.track, options.tensorboard),
    )
