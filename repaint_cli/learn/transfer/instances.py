"""Instance transfer: teachers act in the target task, and the best of their samples are kept."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from repaint_cli.learn.learner import Learner
from repaint_cli.learn.rollout.gae import Samples, describe, to_samples
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.rollout.transitions import transitions
from repaint_cli.learn.seeding import Purpose, generator
from repaint_cli.learn.transfer.course import Course, OwnBatch
from repaint_cli.learn.transfer.relevance import relevance
from repaint_cli.learn.transfer.selection import Selection
from repaint_cli.learn.transfer.teachers import ActingTeacher, soften
from repaint_cli.learn.update.objectives import masked_mean
from repaint_cli.tasks.card import TaskCard


def collect_instances(
    card: TaskCard, learner: Learner, course: Course, k: int
) -> tuple[Samples, dict[str, np.ndarray]]:
    """Let teachers act in the target task; keep the samples worth learning from (section 4.2).

    Advantages are estimated under the target's reward with the student's critic, which is not
    trained here, and which estimated those of the students' own batch too. Several teachers share
    the steps or episodes of one, and their samples are scaled and chosen from together
    (appendix A).

    Returns:
        The chosen samples, and metrics of the selection, (S,) each.
    """
    actors = course.actors()
    rollouts = [_rollout(card, learner, actor, k) for actor in actors]
    if card.transfer.teacher_statistics:
        for rollout in rollouts:
            learner.update_normalizer(rollout)
    pairs = list(zip(actors, rollouts, strict=True))
    samples = Samples.concatenate([_samples(card, learner, *pair) for pair in pairs])
    rngs = [generator(seed, Purpose.SELECT, k) for seed in learner.seeds]
    selection, learned = course.choose(k, samples, rngs, _relevance(card, course.last, pairs))
    metrics = _metrics(samples, selection, course.last)
    metrics["teacher_return"] = np.mean(
        [rollout.mean_episodes()[0] for rollout in rollouts], axis=0
    )
    return selection.at_least(card.select.min_samples).of(learned), metrics


def _rollout(card: TaskCard, learner: Learner, actor: ActingTeacher, k: int) -> Rollout:
    policy = soften(actor.teacher.network, card.transfer)
    return learner.collect_teacher(card, k, policy, which=actor.which, of=actor.of)


def _samples(card: TaskCard, learner: Learner, actor: ActingTeacher, rollout: Rollout) -> Samples:
    """Return a teacher's samples, Â′ by the students' critics; none for those it does not lead."""
    samples = to_samples(rollout, learner.student.value, card.ppo)
    samples = samples.within(card.ppo, actor.which, actor.of)
    if card.ppo.objective == "trpo":
        policy = soften(actor.teacher.network, card.transfer)
        samples = replace(samples, behavior=describe(policy, samples))
    return replace(samples, counts=samples.counts * torch.from_numpy(actor.leads))


def _relevance(
    card: TaskCard, own: OwnBatch, pairs: Sequence[tuple[ActingTeacher, Rollout]]
) -> torch.Tensor | None:
    """Return the relevance of the teachers' samples to the students' batch, (S, B), for `rbt`."""
    if card.select.rule != "rbt":
        return None
    assert own.transitions is not None
    sources = [
        transitions(rollout, actor.teacher.weights).within(card.ppo, actor.which, actor.of)
        for actor, rollout in pairs
    ]
    return relevance(own.transitions, sources, card.select)


def _metrics(samples: Samples, selection: Selection, own: OwnBatch) -> dict[str, np.ndarray]:
    """Return metrics of the selection beside those of the students' own batch, (S,) each."""
    counts = selection.counts
    chosen, nothing = samples.pick(selection.positions, counts), counts == 0
    metrics = {
        "kept_fraction": counts / samples.counts.clamp(min=1),
        "kept_advantage": masked_mean(chosen.advantages, counts).where(~nothing, torch.nan),
        "kept_reward": masked_mean(chosen.rewards, counts).where(~nothing, torch.nan),
        "student_reward": own.reward,
    }
    arrays = {name: values.numpy() for name, values in metrics.items()}
    return arrays | {"student_return": own.episode_return}
