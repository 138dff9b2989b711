"""What is worth saying before a run begins: schedules that end early, slow arithmetic, teachers."""

from repaint_cli.errors import some
from repaint_cli.policies.precision import slowness_warnings
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.progress import RunProgress
from repaint_cli.runs.teachers import RunTeachers
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.methods import METHODS
from repaint_cli.zoo.views import hints_of_views


def notices_of(plan: Plan, teachers: RunTeachers) -> list[str]:
    """Return sentences about a run that is about to begin, or to go on."""
    begun, taught_by = plan.begun is not None, {t.name: t.task.net for t in teachers.cards}
    notices = schedule_warnings(teachers.target, begun=begun)
    notices += slowness_warnings(teachers.target.net, taught_by, begun=begun)
    if not begun:
        notices += teachers.target.env.doubts() + teachers.target.env.notes()
    if plan.device != "cpu":
        where = "evaluations" if teachers.target.gpu_simulator else "the environments"
        notices.append(f"policies learn on {plan.device}; {where} stay on the CPU")
    if plan.task.transfer.distill_epochs and not _distils(plan):
        notices.append(
            "nothing is distilled (transfer.distill_epochs): it needs kickstarting with --beta "
            "above 0, and PPO"
        )
    if plan.algorithm != "ppo":
        numbers = plan.task.ppo
        given = {"normalize_rewards": numbers.normalize_rewards, "target_kl": numbers.target_kl}
        unused = ", ".join(f"ppo.{name}" for name, value in given.items() if value)
        notices += [f"{unused}: not of {plan.algorithm}, and without effect"] * bool(unused)
    if not begun and METHODS[plan.method].needs_teacher and not plan.ranked:
        notices += hints_of_views(teachers.cards, plan.teachers, teachers.target)
    return notices


def _distils(plan: Plan) -> bool:
    """Return whether a teacher advises in some iteration, so that its advice can be distilled."""
    transfer = plan.transfer
    advises = transfer.kickstart_schedule == "auto" or any(transfer.betas(len(plan.teachers) or 1))
    return plan.algorithm == "ppo" and transfer.distill_epochs > 0 and advises


def schedule_warnings(task: TaskCard, begun: bool) -> list[str]:
    """Return a sentence for each schedule that is at 0 before the run ends.

    Args:
        task: as it is carried out.
        begun: whether the run has begun, and keeps its settings.
    """
    ppo, n = task.ppo, task.ppo.n_iterations
    decays = [("learning_rate", "learning_rate_decay", "nothing is learned")]
    if ppo.objective == "clipped":
        decays.append(("clip_range", "clip_decay", "policies hardly learn"))
    sentences = []
    for name, decay, effect in decays:
        end = getattr(ppo, decay)
        if end is not None and end < n:
            way = "the run keeps it as it began" if begun else f"try --set ppo.{decay}={n}"
            sentences.append(
                f"ppo.{name} is 0 from iteration {end + 1} of {n} on, where {effect} "
                f"(ppo.{decay} is {end}); {way}"
            )
    return sentences


def forgotten(task: TaskCard, progress: RunProgress) -> list[str]:
    """Return a sentence about what a reward function kept, and a run that goes on does not know."""
    code, names = task.reward_code, progress.remembered
    if code is None or names == []:
        return []
    what = f"its variables {some(names)} change" if names else "its variables may change"
    return [
        f"{code.name} remembers, as {what}, and they begin anew: from here on this is another run "
        "than one without a stop"
    ]
