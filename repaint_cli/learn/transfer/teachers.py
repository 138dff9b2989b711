"""What teachers give: advice where the student goes, and the best of what they do themselves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from repaint_cli.learn.learner import Learner
from repaint_cli.learn.rollout.batches import front
from repaint_cli.learn.rollout.collect import Policy
from repaint_cli.learn.rollout.gae import Samples, describe, to_samples
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.rollout.transitions import transitions
from repaint_cli.learn.seeding import Purpose, generator
from repaint_cli.learn.transfer import schedules
from repaint_cli.learn.transfer.relevance import relevance
from repaint_cli.learn.transfer.selection import Chosen, rescale, select, top_share
from repaint_cli.learn.update.objectives import masked_mean
from repaint_cli.policies.distributions import Distribution, mixture
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.settings import TransferConfig
from repaint_cli.tasks.card import TaskCard


@dataclass(frozen=True)
class Teacher:
    """A policy to learn from."""

    network: ActorCritic
    """Its policy, standing S times."""
    acts: bool = True
    """Whether its own samples are learned from in instance iterations."""
    weights: np.ndarray | None = None
    """w of its own task in the order of the target's terms, (F,); None where that is not known."""
    cosine: float | None = None
    """Of its task's weights and the target's; None where one is not known."""


def soften(teacher: ActorCritic, transfer: TransferConfig) -> Policy:
    """Return a teacher with a spread, the same for sampling, log-probs and the cross-entropy.

    A trained teacher is nearly deterministic: its samples would have likelihood ratios near 0 under
    any student, and a clipped surrogate with A > 0 has no gradient there.
    """
    return lambda obs, counts: teacher.policy(obs, counts).soften(
        transfer.teacher_min_std, transfer.teacher_temperature
    )


def advise(
    teachers: Sequence[Teacher], betas: Tensor, samples: Samples, transfer: TransferConfig
) -> Distribution | None:
    """Return what the teachers would do at the samples, as one distribution; None with β = 0.

    Args:
        teachers: all of them.
        betas: β_k of each, (M, S).
        samples: of the student, (S, B).
        transfer: the teachers' spread.
    """
    asked = betas.any(1)
    if not asked.any():
        return None
    parts = [
        describe(soften(teacher.network, transfer), samples)
        for teacher, wanted in zip(teachers, asked.tolist(), strict=True) if wanted
    ]  # fmt: skip
    return mixture(parts, betas[asked])


def transfer_instances(
    task: TaskCard, learner: Learner, teachers: Sequence[Teacher], k: int
) -> tuple[Samples, dict[str, np.ndarray]]:
    """Let teachers act in the target task; keep what is worth learning from (section 4.2).

    Advantages are estimated under the target's reward with the student's critic, which is not
    trained here, and which judged `learner.last_moments` too. Several teachers share the steps or
    episodes of one, and their samples are scaled and chosen from together (appendix A).

    Returns:
        The chosen samples and what the selection looked like, (S,) per number.
    """
    acting, of = actors(teachers, task, learner), sum(teacher.acts for teacher in teachers)
    rollouts = [
        learner.watch(
            task, k, soften(actor.teacher.network, task.transfer), which=actor.which, of=of
        )
        for actor in acting
    ]
    if task.transfer.teacher_statistics:
        for rollout in rollouts:
            learner.see(rollout)
    samples = Samples.together(_judged(task, learner, acting, rollouts, of))
    chosen, scaled = _chosen(task, learner, k, samples, acting, rollouts, of)
    raw, counts = samples.pick(chosen.positions, chosen.counts), chosen.counts
    nothing = counts == 0
    numbers = {
        "kept_fraction": counts / samples.counts.clamp(min=1),
        "kept_advantage": masked_mean(raw.advantages, counts).where(~nothing, torch.nan),
        "kept_reward": masked_mean(raw.rewards, counts).where(~nothing, torch.nan),
        "student_reward": learner.last_reward,
    }
    told = {name: number.numpy() for name, number in numbers.items()}
    told["student_return"] = learner.last_return
    told["teacher_return"] = np.mean([rollout.mean_episodes()[0] for rollout in rollouts], axis=0)
    return chosen.of(scaled), told


class Actor(NamedTuple):
    """A teacher who acts."""

    teacher: Teacher
    which: int
    """Its number among those who may act, which names its share and its noise."""
    leads: np.ndarray
    """Which seeds learn from its samples, (S,) bool."""


def actors(teachers: Sequence[Teacher], task: TaskCard, learner: Learner) -> list[Actor]:
    """Return the teachers who act.

    All who may do, unless it is decided by what is measured: then each teaches those whom it is
    ahead of, and who is ahead of nobody does not act.
    """
    leading = np.ones((len(teachers), len(learner.seeds)), bool)
    if learner.measured and task.select.rule == "auto":
        leading = learner.measured.leading
    pairs = [(t, leads) for t, leads in zip(teachers, leading, strict=True) if t.acts]
    return [Actor(t, which, leads) for which, (t, leads) in enumerate(pairs) if leads.any()]


def _judged(
    task: TaskCard, learner: Learner, acting: Sequence[Actor], rollouts: Sequence[Rollout], of: int
) -> list[Samples]:
    """Return each acting teacher's samples, as the student's critic sees them."""
    parts = []
    for actor, rollout in zip(acting, rollouts, strict=True):
        part = to_samples(rollout, learner.student.value, task.ppo)
        part = part.within(task.ppo, actor.which, of)
        if task.ppo.objective == "trpo":
            policy = soften(actor.teacher.network, task.transfer)
            part = replace(part, behavior=describe(policy, part))
        parts.append(replace(part, counts=part.counts * torch.from_numpy(actor.leads)))
    return parts


def _chosen(
    task: TaskCard,
    learner: Learner,
    k: int,
    samples: Samples,
    acting: Sequence[Actor],
    rollouts: Sequence[Rollout],
    of: int,
) -> tuple[Chosen, Samples]:
    """Return which samples to learn from, and all of them on the scale they were chosen on."""
    if learner.measured and task.select.rule == "auto":
        scaled = rescale(samples, "student-batch", learner.last_moments)
        return Chosen(*front(top_share(scaled, learner.measured.shares(samples)))), scaled
    scaled = rescale(samples, task.select.scale, learner.last_moments)
    if learner.measured:
        learner.measured.shares(samples)  # which the next phase goes by
    by_relevance = task.select.rule == "rbt"
    relevant = _relevance(task, learner, acting, rollouts, of) if by_relevance else None
    rngs = [generator(seed, Purpose.SELECT, k) for seed in learner.seeds]
    threshold = schedules.threshold(k, task.select, task.transfer)
    return select(scaled, task.select, threshold, rngs, relevant), scaled


def _relevance(
    task: TaskCard, learner: Learner, acting: Sequence[Actor], rollouts: Sequence[Rollout], of: int
) -> torch.Tensor:
    """Return the relevance of the teachers' samples to the student's last batch, (S, B)."""
    assert learner.last_batch is not None
    sources = [
        transitions(rollout, actor.teacher.weights).within(task.ppo, actor.which, of)
        for rollout, actor in zip(rollouts, acting, strict=True)
    ]
    return relevance(learner.last_batch, sources, task.select)
