"""What automatic transfer goes by: how teachers and students do when they are evaluated."""

from collections.abc import Sequence

from repaint_cli.envs.episodes import Episodes
from repaint_cli.errors import CardError, locate_divergence
from repaint_cli.learn.evaluation import evaluate
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.ppo import IterationStats
from repaint_cli.learn.transfer.measured import Measured
from repaint_cli.learn.transfer.teachers import Teacher
from repaint_cli.tasks.card import TaskCard


def check_episodes(task: TaskCard) -> None:
    """Check that an evaluation has episodes enough for a standard error.

    Raises:
        CardError: it has one.
    """
    if task.automatic and task.eval.episodes < 2:
        raise CardError(
            "expected at least 2 episodes per evaluation where the transfer is automatic, found "
            f"{task.eval.episodes}; try --eval-episodes 5"
        )


def measure(task: TaskCard, learner: Learner, teachers: Sequence[Teacher]) -> None:
    """Evaluate students and teachers in the target task; such episodes count as steps.

    Raises:
        DivergedError: an observation or a reward is not finite.
    """
    networks = [learner.student, *(teacher.network for teacher in teachers)]
    with locate_divergence(learner.seeds, "evaluation before the first iteration"):
        played = [evaluate(net, task, learner.seeds, task.eval.episodes) for net in networks]
    learner.env_steps += sum(episodes.lengths.sum(1) for episodes in played)
    own, *taught = [episodes.returns for episodes in played]
    learner.measured = Measured(own, taught)


def inform(task: TaskCard, learner: Learner, stats: IterationStats, played: Episodes) -> None:
    """Take in an evaluation, as long as the transfer lasts; such episodes count as steps."""
    if learner.measured is None or learner.measured.ended:
        return
    if stats.iteration < task.transfer.iterations:
        learner.measured.see_student(played.returns, stats.steps, stats.phase)
        learner.env_steps += played.lengths.sum(1)
