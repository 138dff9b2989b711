"""What an automatic transfer measures, before it begins and while it runs, and what it costs."""

import numpy as np

from repaint_cli.envs.episodes import Episodes
from repaint_cli.errors import CardError
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.stats import IterationStats
from repaint_cli.learn.transfer.course import Course
from repaint_cli.learn.transfer.measurements import Measurements
from repaint_cli.runs.plan import Plan


def measurements_of(plan: Plan) -> Measurements | None:
    """Return what was measured before a run whose transfer is automatic, None of others.

    Raises:
        CardError: nothing was measured, as the run was begun by an earlier version.
    """
    if not (plan.target.automatic and plan.teachers):
        return None
    taught = {which: one for one in plan.ranked for which in one.teachers}
    if not taught:
        raise CardError(
            "expected what teachers earn, which an automatic transfer measures before it begins, "
            "found none; begin the run anew"
        )
    *_, untrained = plan.ranked
    start = 0 if plan.target.transfer.start == "teacher" else None
    in_order = [np.array(taught[which].returns) for which in sorted(taught)]
    each_seed = (len(plan.seeds), 1)
    return Measurements(
        np.tile(untrained.returns, each_seed),
        [np.tile(returns, each_seed) for returns in in_order],
        start=start,
    )


def first_length(plan: Plan) -> float:
    """Return how long episodes are of students who start from a teacher, 0 where it did not play.

    The first rollout has as many episodes as that allows, where `ppo.max_steps` is a limit.
    """
    first = next((one for one in plan.ranked if 0 in one.teachers), None)
    return first.steps / len(first.returns) if first and plan.task.ppo.max_steps else 0.0


def inform_course(
    learner: Learner, course: Course, stats: IterationStats, evaluation: Episodes
) -> None:
    """Give a course the evaluation after an iteration; count those episodes that it used."""
    used = course.after_evaluation(stats.iteration, stats.steps, evaluation)
    learner.env_steps += evaluation.lengths[:, :used].sum(1)
