"""`repaint transfer`."""

from pathlib import Path
from typing import TYPE_CHECKING

from repaint_cli.cli.dry_run import dry_run
from repaint_cli.cli.imported_screen import screen
from repaint_cli.cli.option_rules import (
    check_card,
    check_method,
    check_resume,
    check_together,
    is_typed,
    parsed_into,
    settings_of,
)
from repaint_cli.cli.option_values import seed_list, task_named, trackers
from repaint_cli.cli.transfer_options import TransferOptions

if TYPE_CHECKING:
    from repaint_cli.runs.plan import Plan
    from repaint_cli.tasks.card import TaskCard


@parsed_into(TransferOptions)
def transfer(options: TransferOptions) -> None:
    """Transfer a teacher to a new task.

    With REPAINT, or with a method to compare it with.

    Examples:
        repaint transfer --teacher racer-inner --task racer-outer
        repaint transfer --task reacher --method scratch --seeds 5
    """
    import repaint_cli
    from repaint_cli.tasks.methods import method_for
    from repaint_cli.tasks.presets import automatic, with_preset

    if options.resume:
        return _resume(options, options.resume)
    algorithm = options.algorithm
    method = method_for(algorithm, options.method)
    check_method(options, method, algorithm)
    task = repaint_cli.load_task(task_named(options.task))
    check_together(options)
    settings = settings_of(options, algorithm)
    card = with_preset(task, options.preset).with_settings(settings)
    if options.automatic:
        card = automatic(card, settings, algorithm, method)
    check_card(options, card, algorithm)
    seeds = seed_list(options.seed, options.seeds)
    if options.dry_run:
        return dry_run(task, lambda: [_plan(options, card, seeds, method)])
    return screen().run(
        repaint_cli.transfer,
        card,
        options.teacher or (),
        method=method,
        algorithm=algorithm,
        auto=False,  # the card says it already
        view=_view(options),
        instances_from=options.instances_from or (),
        seeds=seeds,
        folder=options.run,
        keep=options.keep,
        track=trackers(options.track, options.tensorboard),
        device=options.device,
    )


def _plan(options: TransferOptions, card: "TaskCard", seeds: list[int], method: str) -> "Plan":
    """Return what would be done."""
    from repaint_cli.runs.start import plan_transfer

    return plan_transfer(
        card, options.teacher or (), seeds, method, options.algorithm,
        options.instances_from or (), options.run, options.keep, _view(options), options.device,
    )  # fmt: skip


def _view(options: TransferOptions) -> str:
    """Return how teachers without a view of their own are looked at."""
    return options.view or ("auto" if options.automatic else "none")


def _resume(options: TransferOptions, folder: Path) -> None:
    """Go on with the run in a folder."""
    import repaint_cli

    check_resume(options, options.context)
    screen().run(
        repaint_cli.resume,
        folder,
        iterations=options.iterations,
        track=trackers(options.track, options.tensorboard),
        for_teacher=False,
        device=options.device if is_typed(options.context, "device") else None,
    )
