"""`repaint train-teacher`."""

from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from repaint_cli.cli.dry_run import dry_run
from repaint_cli.cli.imported_screen import screen
from repaint_cli.cli.option_rules import Rule, check_resume, is_typed, parsed_into, settings_of
from repaint_cli.cli.option_values import seed_list, task_named, trackers
from repaint_cli.cli.options import (
    WHERE,
    Device,
    DryRun,
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

if TYPE_CHECKING:
    from repaint_cli.runs.plan import Plan
    from repaint_cli.tasks.card import TaskCard


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
    device: Device = "cpu"
    dry_run: DryRun = False
    resume: Resume = None
    name: Annotated[
        str | None,
        option(
            WHERE, "NAME", "The teacher's name in your zoo. Default: the task's, which is replaced."
        ),
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
    from repaint_cli.tasks.presets import with_preset

    if options.resume:
        check_resume(options, options.context)
        return screen().run(
            repaint_cli.resume,
            options.resume,
            iterations=options.iterations,
            name=options.name,
            replace=options.replace,
            track=trackers(options.track, options.tensorboard),
            for_teacher=True,
            device=options.device if is_typed(options.context, "device") else None,
        )
    task = repaint_cli.load_task(task_named(options.task))
    card = with_preset(task, options.preset).with_settings(settings_of(options))
    seeds = seed_list(options.seed, options.seeds)
    if options.dry_run:
        return dry_run(task, lambda: [_plan(options, card, seeds)])
    return screen().run(
        repaint_cli.train,
        card,
        seeds=seeds,
        name=options.name,
        replace=options.replace,
        folder=options.run,
        keep=options.keep,
        track=trackers(options.track, options.tensorboard),
        device=options.device,
    )


def _plan(options: TrainTeacherOptions, card: "TaskCard", seeds: list[int]) -> "Plan":
    """Return what would be done."""
    from repaint_cli.runs.start import plan_teacher

    return plan_teacher(
        card, seeds, options.name, options.replace, options.run, options.keep, options.device
    )
