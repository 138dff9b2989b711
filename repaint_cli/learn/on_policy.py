"""The students' own iterations: act, estimate advantages, learn, with the teachers' advice."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from repaint_cli.learn.learner import Learner, without_sights
from repaint_cli.learn.rollout.gae import Samples, describe, to_samples
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.rollout.transitions import transitions
from repaint_cli.learn.transfer import schedules
from repaint_cli.learn.transfer.selection import moments, standardize
from repaint_cli.learn.transfer.teachers import Teacher, actors, advise, transfer_instances
from repaint_cli.learn.update.compiled.update import Parts
from repaint_cli.learn.update.epochs import learn_on_policy
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.settings import PPOConfig, TransferConfig
from repaint_cli.tasks.card import TaskCard


def own_iteration(
    task: TaskCard,
    learner: Learner,
    k: int,
    teachers: Sequence[Teacher],
    phase: schedules.Phase,
) -> tuple[dict[str, np.ndarray], Rollout]:
    """Let the students act and learn from it: PPO, with the cross-entropy where β_k > 0.

    Advantages are from before the critic's fit, and both networks learn at once; or with
    `ppo.advantages` "after" the critic learns first, as algorithms 1 and 2 write.

    Args:
        task: the target task.
        learner: who learns.
        k: the iteration.
        teachers: whose advice, and in a joint iteration (algorithm 1) whose samples, are used.
        phase: what the iteration is.

    Returns:
        The iteration's numbers, (S,) each, and the rollout without its observations.
    """
    student, ppo = learner.student, task.ppo
    rollout = learner.act(task, k)
    learner.see(rollout)
    samples = _own_samples(student, rollout, ppo)
    numbers = {"explained_variance": _explained_variance(samples).numpy()}
    _remember(task, learner, rollout, samples, teachers)
    if phase == "critic":
        numbers |= _learn(task, learner, k, samples, "critic")
        return numbers | _own_numbers(rollout), without_sights(rollout)
    parts: Parts = "both"
    if ppo.advantages == "after":
        numbers |= _learn(task, learner, k, samples, "critic")
        judged = to_samples(rollout, student.value, ppo)
        samples, parts = replace(samples, advantages=judged.advantages), "policy"
        _remember(task, learner, rollout, samples, teachers)
    numbers |= _learn(task, learner, k, samples, parts, teachers, joint=phase == "joint")
    _judge_again(task, learner, k, rollout, teachers)
    return numbers | _own_numbers(rollout), without_sights(rollout)


def _own_samples(student: ActorCritic, rollout: Rollout, ppo: PPOConfig) -> Samples:
    """Return the students' samples, after their normaliser has seen what they saw."""
    samples = to_samples(rollout, student.value, ppo)
    if not student.normalizer and ppo.objective != "trpo":
        return samples
    policy = describe(student.policy, samples)
    if student.normalizer:  # new statistics make a new π_old: the first ratio is to be 1
        samples = replace(samples, behavior_log_probs=policy.log_prob(samples.actions))
    return replace(samples, behavior=policy if ppo.objective == "trpo" else None)


def _remember(
    task: TaskCard,
    learner: Learner,
    rollout: Rollout,
    samples: Samples,
    teachers: Sequence[Teacher],
) -> None:
    """Keep what the teachers' samples will be judged against."""
    by_relevance = teachers and task.transfer.instance and task.select.rule == "rbt"
    learner.remember(rollout, samples, transitions(rollout) if by_relevance else None)
    if learner.measured and task.transfer.joint:  # else they are judged again before teachers act
        learner.measured.see_advantages(samples)


def _judge_again(
    task: TaskCard, learner: Learner, k: int, rollout: Rollout, teachers: Sequence[Teacher]
) -> None:
    """Let the critic, now fitted, judge the students' batch as it will judge the teachers'."""
    measured = learner.measured and not learner.measured.ended
    asked = measured or task.select.scale == "student-batch"
    if not (teachers and asked and k < task.transfer.iterations) or task.transfer.joint:
        return
    judged = to_samples(rollout, learner.student.value, task.ppo)
    learner.last_moments = moments(judged)
    if learner.measured:
        learner.measured.see_advantages(judged)


def _learn(
    task: TaskCard,
    learner: Learner,
    k: int,
    samples: Samples,
    parts: Parts,
    teachers: Sequence[Teacher] = (),
    *,
    joint: bool = False,
) -> dict[str, np.ndarray]:
    """Take the gradient steps; Â is standardised over all samples, then no more kept than asked."""
    transfer, rngs = task.transfer, learner.shuffles(k)
    batch = standardize(samples, moments(samples)).within(task.ppo)
    if parts == "critic":
        return learn_on_policy(
            learner.student, learner.optimizer, batch, task.ppo, rngs, parts=parts
        )
    kept, numbers = None, dict[str, np.ndarray]()
    betas = betas_of(k, transfer, learner, teachers)
    if joint and actors(teachers, task, learner):
        kept, numbers = transfer_instances(task, learner, teachers, k)
    taught = teachers and not (learner.measured and learner.measured.ended)
    alpha_1, _ = schedules.alphas(k, transfer) if taught else (1.0, 1.0)
    numbers |= learn_on_policy(
        learner.student, learner.optimizer, batch, task.ppo, rngs,
        teacher=advise(teachers, betas, batch, transfer), beta=betas.sum(0),
        rate=schedules.power(k, transfer) if joint else alpha_1,
        instances=kept, alphas=(transfer.alpha_1, transfer.alpha_2), parts=parts,
    )  # fmt: skip
    return numbers | {"kickstart_coef": betas.sum(0).numpy()}


def betas_of(
    k: int, transfer: TransferConfig, learner: Learner, teachers: Sequence[Teacher]
) -> Tensor:
    """Return β_k of each teacher for each seed, (M, S), by a schedule or by what was measured."""
    nothing = torch.zeros(len(teachers), len(learner.seeds), dtype=torch.float64)
    if not teachers or k > transfer.iterations:
        return nothing
    coefs = schedules.kickstart_coefs(k, transfer, len(teachers))
    betas = nothing + torch.tensor(coefs, dtype=torch.float64).unsqueeze(1)
    if not learner.measured:
        return betas
    if learner.measured.ended:
        return nothing
    found = learner.measured.betas([teacher.cosine for teacher in teachers])
    learner.measured.note(found)
    return torch.from_numpy(found) if transfer.kickstart_schedule == "auto" else betas


def _own_numbers(rollout: Rollout) -> dict[str, np.ndarray]:
    """Return each seed's mean return and length of the episodes that ended, nan of none, (S,)."""
    returns, lengths = rollout.mean_episodes()
    return {"episode_return": returns, "episode_length": lengths}


def _explained_variance(samples: Samples) -> Tensor:
    """Return 1 − Var(R̂ − V) / Var(R̂), (S,): how much of the returns the critic knew beforehand."""
    _, error = moments(samples)  # R̂ = Â + V, so R̂ − V = Â
    _, spread = moments(replace(samples, advantages=samples.returns))
    return (1 - error**2 / (spread**2).clamp(min=1e-12)).squeeze(1)
