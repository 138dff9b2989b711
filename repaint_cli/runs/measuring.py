"""Evaluations that decide the course of a transfer: their episodes count as steps."""

import numpy as np

from repaint_cli.envs.episodes import Episodes
from repaint_cli.errors import CardError, locate_divergence
from repaint_cli.learn.evaluation import evaluate
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.stats import IterationStats
from repaint_cli.learn.transfer.course import Course
from repaint_cli.policies.mirror import PolicyNetwork
from repaint_cli.tasks.card import TaskCard


def check_episodes(card: TaskCard) -> None:
    """Check that an evaluation has episodes enough for a standard error.

    Raises:
        CardError: the transfer is automatic, and an evaluation has one episode.
    """
    if card.automatic and card.eval.episodes < 2:
        raise CardError(
            "expected at least 2 episodes per evaluation where the transfer is automatic, found "
            f"{card.eval.episodes}; try --eval-episodes 5"
        )


def begin_course(card: TaskCard, learner: Learner, course: Course) -> None:
    """Let a course evaluate students and teachers before the first iteration, if it needs to.

    Raises:
        DivergedError: an observation or a reward is not finite.
    """

    def evaluate_network(network: PolicyNetwork) -> np.ndarray:
        episodes = evaluate(network, card, learner.seeds, card.eval.episodes)
        learner.env_steps += episodes.lengths.sum(1)
        return episodes.returns

    with locate_divergence(learner.seeds, "evaluation before the first iteration"):
        course.begin(learner.student, evaluate_network)


def inform_course(
    learner: Learner, course: Course, stats: IterationStats, evaluation: Episodes
) -> None:
    """Give a course the evaluation after an iteration; count its episodes if it was used."""
    used = course.after_evaluation(stats.iteration, stats.phase, stats.steps, evaluation.returns)
    if used:
        learner.env_steps += evaluation.lengths.sum(1)
