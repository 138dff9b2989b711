"""The score of a policy on its own task, on seeds that training never used."""

from repaint_cli.learn.evaluation import evaluate
from repaint_cli.learn.seeding import Purpose
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.report.statistics import mean_ci
from repaint_cli.tasks.card import TaskCard
from repaint_cli.zoo.teacher_card import Score


def score(network: ActorCritic, task: TaskCard, seed: int) -> Score:
    """Evaluate one policy on seeds that no training or evaluation has used."""
    least = task.env.score_episodes
    evaluation = evaluate(network, task, [seed], least, purpose=Purpose.SCORE)
    episodes = evaluation.returns.shape[1]
    mean, low, high = mean_ci(evaluation.returns[0])
    laps = progress = None
    if evaluation.progress is not None:
        progress, laps = float(evaluation.progress.mean()), int((evaluation.progress >= 100).sum())
    return Score(mean=mean, low=low, high=high, episodes=episodes, progress=progress, laps=laps)
