"""`repaint transfer`."""

from repaint_cli.cli.option_rules import (
    check_card,
    check_method,
    check_resume,
    check_together,
    parsed_into,
    settings_of,
)
from repaint_cli.cli.option_values import method_for, seed_list, task_named
from repaint_cli.cli.transfer_options import TransferOptions


@parsed_into(TransferOptions)
def transfer(options: TransferOptions) -> None:
    """Transfer a teacher to a new task.

    With REPAINT, or with a method to compare it with.

    Examples:
        repaint transfer --teacher racer-inner --task racer-outer
        repaint transfer --task reacher --method scratch --seeds 5
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

    if options.resume:
        check_resume(options, options.context)
        plan = plan_again(options.resume, options.iterations)
        return carry_out(plan, options.tensorboard, resume=True)
    algorithm = options.algorithm
    method = method_for(algorithm, options.method)
    check_method(options, method, algorithm)
    options = options.with_auto()
    card = read_task(task_named(options.task))
    check_together(options)
    card = card.with_settings(settings_of(options, algorithm))
    check_card(options, card, algorithm)
    teachers = find_teachers(options.teacher, method)
    acting = find_acting(options.instances_from, teachers)
    names = [algorithm] * (algorithm != "ppo") + [method, *(path.stem for path in teachers)]
    plan = Plan(
        card,
        method,
        seed_list(options.seed, options.seeds),
        new_folder(options.run, card.name, "-".join(names)),
        teachers,
        acting,
        algorithm,
        keep=options.keep,
    )
    carry_out(plan, options.tensorboard)
