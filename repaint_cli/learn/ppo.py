"""The loop of algorithms 1 and 2; it yields statistics, and neither writes nor prints."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from repaint_cli.errors import DivergedError, locate_divergence
from repaint_cli.learn.distillation import distil
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.rollout.gae import Samples, describe, to_samples
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.stats import IterationStats, Meter
from repaint_cli.learn.transfer.course import Course
from repaint_cli.learn.transfer.instances import collect_instances
from repaint_cli.learn.transfer.iteration import Iteration
from repaint_cli.learn.transfer.selection import moments, standardize
from repaint_cli.learn.transfer.teachers import advise
from repaint_cli.learn.update.objectives import masked_mean
from repaint_cli.learn.update.spec import UpdateSpec
from repaint_cli.learn.update.update import update
from repaint_cli.policies.distributions import Distribution
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.settings import PPOConfig
from repaint_cli.tasks.card import TaskCard


def train(card: TaskCard, learner: Learner, course: Course) -> Iterator[IterationStats]:
    """Train until the card's number of iterations, yielding after each (paper, algorithms 1 and 2).

    Args:
        card: the target task; with β₀ = 0 and I = 0 this is clipped PPO.
        learner: where to start from; it is changed in place.
        course: what the teachers contribute, and when; it is changed in place.

    Raises:
        CardError: the task cannot be rolled out as its card says.
        DivergedError: an observation, a reward, a loss or a weight is not finite.
    """
    card.check_rollout()
    for k in range(learner.iteration + 1, card.ppo.n_iterations + 1):
        meter, now, rollout = Meter(learner), course.start(k), None
        learner.optimizer.learning_rate = now.learning_rate
        with locate_divergence(learner.seeds, f"iteration {k}"):
            if now.phase == "instance":
                metrics = instance_iteration(card, learner, course, now)
            else:
                metrics, rollout = on_policy_iteration(card, learner, course, now)
            _check_weights(learner)
        learner.iteration = k
        course.finish(now.phase)
        yield meter.stats(now.phase, metrics, rollout)


def instance_iteration(
    card: TaskCard, learner: Learner, course: Course, now: Iteration
) -> dict[str, np.ndarray]:
    """Let teachers act, and train the policies on the best of it (algorithm 2, even k).

    Returns:
        The iteration's metrics, (S,) each.
    """
    instances, metrics = collect_instances(card, learner, course, now.k)
    spec = UpdateSpec(
        card.ppo, now.clip_range, loss="instance", networks="policy", policy_scale=now.policy_scale,
        importance=card.transfer.importance,
    )  # fmt: skip
    student, rngs = learner.student, learner.shuffles(now.k)
    before = describe(student.policy, instances) if instances.counts.any() else None
    metrics |= update(student, learner.optimizer, instances, spec, rngs)
    return metrics | (_moved(student, before, instances) if before else {})


def _moved(student: ActorCritic, before: Distribution, samples: Samples) -> dict[str, np.ndarray]:
    """Return how far policies have moved at samples, the mean KL(π_before‖π), (S,); nan of none."""
    mean = masked_mean(before.kl(describe(student.policy, samples)), samples.counts)
    return {"instance_kl": mean.where(samples.counts > 0, torch.nan).numpy()}


def on_policy_iteration(
    card: TaskCard, learner: Learner, course: Course, now: Iteration
) -> tuple[dict[str, np.ndarray], Rollout]:
    """Let the students act and learn from it: PPO, with the cross-entropy where β_k > 0.

    Advantages are from before the critic's fit, and both networks learn at once; or with
    `ppo.advantages` "after" the critic learns first, as algorithms 1 and 2 write (odd k).

    Returns:
        The iteration's metrics, (S,) each, and the rollout without its observations.
    """
    student, ppo = learner.student, card.ppo
    rollout = learner.collect(card, now.k)
    learner.update_normalizer(rollout)
    samples = _own_samples(student, rollout, ppo)
    course.keep_batch(rollout, samples)
    returns, lengths = rollout.mean_episodes()
    metrics = {
        "episode_return": returns,
        "episode_length": lengths,
        "explained_variance": _explained_variance(samples).numpy(),
    }
    critic_first = now.phase == "critic" or ppo.advantages == "after"
    if critic_first:
        metrics |= _fit_critic(card, learner, now, samples)
    if now.phase != "critic":
        if critic_first:
            fitted = to_samples(rollout, student.value, ppo)
            samples = replace(samples, advantages=fitted.advantages)
            course.keep_batch(rollout, samples)
        metrics |= _learn(card, learner, course, now, samples)
        course.after_own_iteration(now.k, lambda: to_samples(rollout, student.value, ppo))
    return metrics, rollout.without_observations()


def _own_samples(student: ActorCritic, rollout: Rollout, ppo: PPOConfig) -> Samples:
    """Return the students' samples, by their normalisers as they are after the rollout."""
    samples = to_samples(rollout, student.value, ppo)
    normalizes = student.normalizer is not None and student.normalizer.active
    if not (normalizes or ppo.kl_weight):
        return samples
    policy = describe(student.policy, samples)
    if normalizes:  # new statistics make a new π_old: the first ratio is to be 1
        samples = replace(samples, behavior_log_probs=policy.log_prob(samples.actions))
    return replace(samples, behavior=policy if ppo.kl_weight else None)


def _batch(samples: Samples, ppo: PPOConfig) -> Samples:
    """Return what is learned from: Â standardised over all samples, then no more than n_steps."""
    return standardize(samples, moments(samples)).within(ppo)


def _fit_critic(
    card: TaskCard, learner: Learner, now: Iteration, samples: Samples
) -> dict[str, np.ndarray]:
    """Fit V to the returns, and leave the policies alone."""
    spec = UpdateSpec(card.ppo, now.clip_range, networks="critic")
    batch, rngs = _batch(samples, card.ppo), learner.shuffles(now.k)
    return update(learner.student, learner.optimizer, batch, spec, rngs)


def _learn(
    card: TaskCard, learner: Learner, course: Course, now: Iteration, samples: Samples
) -> dict[str, np.ndarray]:
    """Follow L_rep, and in a joint iteration L_ins with it; fit V unless that is done already."""
    batch, transfer = _batch(samples, card.ppo), card.transfer
    instances, metrics = None, dict[str, np.ndarray]()
    if now.phase == "joint" and course.actors():
        instances, metrics = collect_instances(card, learner, course, now.k)
    spec = UpdateSpec(
        card.ppo,
        now.clip_range,
        networks="policy" if card.ppo.advantages == "after" else "both",
        teacher=advise(course.teachers, now.betas, batch, transfer),
        beta=now.betas.sum(0),
        policy_scale=now.policy_scale,
        instances=instances,
        instance_scale=now.instance_scale,
        importance=transfer.importance,
    )
    metrics |= update(learner.student, learner.optimizer, batch, spec, learner.shuffles(now.k))
    if now.distils and spec.teacher is not None:
        metrics |= distil(card, learner, now, batch, spec.teacher)
    return metrics | {"kickstart_coef": now.betas.sum(0).numpy()}


def _explained_variance(samples: Samples) -> Tensor:
    """Return 1 − Var(R̂ − V) / Var(R̂), (S,): how much of the returns the critic predicted."""
    _, error = moments(samples)  # R̂ = Â + V, so R̂ − V = Â
    _, spread = moments(replace(samples, advantages=samples.returns))
    return (1 - error**2 / (spread**2).clamp(min=1e-12)).squeeze(1)


def _check_weights(learner: Learner) -> None:
    finite = torch.isfinite(learner.student.storage).all(1)
    if not finite.all():
        raise DivergedError(
            "expected finite weights after the last step, found some that are not; "
            "a smaller ppo.learning_rate may help",
            row=int((~finite).nonzero()[0]),
        )
