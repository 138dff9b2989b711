"""The loop of algorithms 1 and 2; it yields what happened and knows no files and no screen."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np
import torch
from torch import Tensor

from repaint_cli.config import PPOConfig, TransferConfig
from repaint_cli.errors import DivergedError, telling_where
from repaint_cli.learn import schedules
from repaint_cli.learn.advantages import Samples, describe, to_samples
from repaint_cli.learn.by_hand import Parts
from repaint_cli.learn.frames import Frames
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.seeding import Purpose, generator
from repaint_cli.learn.selection import moments, standardize
from repaint_cli.learn.tape import Rollout
from repaint_cli.learn.teachers import Teacher, advise, transfer_instances
from repaint_cli.learn.transitions import transitions
from repaint_cli.learn.update import learn_from_instances, learn_on_policy
from repaint_cli.nets import ActorCritic
from repaint_cli.tasks import TaskCard


@dataclass(frozen=True)
class IterationStats:
    """What one iteration did, a number per seed."""

    iteration: int
    """k, from 1."""
    phase: schedules.Phase
    """What the iteration was."""
    numbers: dict[str, np.ndarray]
    """The vocabulary of metrics.csv, (S,) each."""
    rollout: Rollout | None = None
    """How the student itself drove, without what it saw; None where the teacher did."""


def train(
    task: TaskCard, learner: Learner, teachers: Sequence[Teacher] = ()
) -> Iterator[IterationStats]:
    """Train until the task's number of iterations, yielding after each (paper, algorithms 1 and 2).

    Args:
        task: the target task; its `transfer` says what the teachers contribute, and with β₀ = 0 and
            I = 0 this is clipped PPO.
        learner: where to start from; it is changed in place.
        teachers: whom to learn from, if anyone.

    Raises:
        CardError: the task cannot be rolled out as its card says.
        DivergedError: an observation, a reward, a loss or a weight is not finite.
    """
    task.check_rollout()
    for k in range(learner.iteration + 1, task.ppo.n_iterations + 1):
        started, before = perf_counter(), learner.env_steps.copy()
        phase = phase_of(k, task, learner) if teachers else "ppo"
        now = task.model_copy(update={"ppo": schedules.ppo(k, task.ppo)})
        learner.optimizer.learning_rate = now.ppo.learning_rate
        with telling_where(learner.seeds, f"iteration {k}"):
            rollout = None
            if phase == "instance":
                numbers = _instance_iteration(now, learner, k, teachers)
            else:
                numbers, rollout = _on_policy_iteration(now, learner, k, teachers, phase)
                if phase == "representation" and not numbers["kickstart_coef"].any():
                    phase = "ppo"  # nobody had anything to say
            _check_weights(learner)
        learner.iteration, learner.after_instance = k, phase == "instance"
        taken, seconds = learner.env_steps - before, perf_counter() - started
        numbers["env_steps"] = learner.env_steps.copy()
        numbers["steps_per_second"] = np.full(taken.shape, taken.sum() / seconds)
        yield IterationStats(k, phase, numbers, rollout)


def _instance_iteration(
    task: TaskCard, learner: Learner, k: int, teachers: Sequence[Teacher]
) -> dict[str, np.ndarray]:
    """Let teachers act and the student learn from the best of it (algorithm 2, even k)."""
    kept, numbers = transfer_instances(task, learner, teachers, k)
    _, alpha_2 = schedules.alphas(k, task.transfer)
    return numbers | learn_from_instances(
        learner.student, learner.optimizer, kept, task.ppo, _shuffles(learner, k),
        alpha_2,
    )  # fmt: skip


def _on_policy_iteration(
    task: TaskCard,
    learner: Learner,
    k: int,
    teachers: Sequence[Teacher],
    phase: schedules.Phase,
) -> tuple[dict[str, np.ndarray], Rollout]:
    """Let the student act and learn from it: PPO, with the cross-entropy where β_k > 0.

    Args:
        task: the target task.
        learner: who learns.
        k: the iteration.
        teachers: whose advice, and in a joint iteration (algorithm 1) whose samples, are used.
        phase: what the iteration is.

    Returns:
        The iteration's numbers, (S,) each, and the rollout without its observations.
    """
    student, ppo, transfer = learner.student, task.ppo, task.transfer
    rollout = learner.act(task, k)
    learner.see(rollout)
    samples = _own_samples(student, rollout, ppo)
    explained = _explained_variance(samples)
    learner.remember(rollout, samples, transitions(rollout) if task.select.rule == "rbt" else None)
    batch = _prepared(samples, ppo)
    kept, numbers = None, dict[str, np.ndarray]()
    if phase == "joint":
        kept, numbers = transfer_instances(task, learner, teachers, k)
    betas = betas_of(k, transfer, learner, teachers)
    beta = betas.sum(0)
    alpha_1, alpha_2 = schedules.alphas(k, transfer)
    numbers |= _fit(
        task, learner, k, rollout, batch, phase,
        teacher=advise(teachers, betas, batch, transfer), beta=beta,
        alpha_1=alpha_1 if teachers else 1.0, instances=kept, alpha_2=alpha_2,
    )  # fmt: skip
    judged_again = learner.measured or task.select.scale == "student-batch"
    if teachers and judged_again and k < transfer.iterations:
        judged = to_samples(rollout, student.value, ppo)
        learner.last_moments = moments(judged)
        if learner.measured:
            learner.measured.see_advantages(judged)
    numbers["kickstart_coef"] = beta.numpy()
    numbers["explained_variance"] = explained.numpy()
    numbers |= episode_numbers(rollout, student.n_seeds)
    return numbers, without_sights(rollout)


def phase_of(k: int, task: TaskCard, learner: Learner) -> schedules.Phase:
    """Return what iteration k does: by R and I, or by what was measured."""
    phase, transfer = schedules.phase(k, task.transfer), task.transfer
    if not learner.measured or phase in ("critic", "joint") or k > transfer.iterations:
        return phase
    if learner.measured.ended:
        return "ppo"
    if transfer.phases == "auto":
        may = k > 1 + transfer.critic_warmup and not learner.after_instance
        return "instance" if may and learner.measured.instance_next() else "representation"
    return phase


def betas_of(
    k: int, transfer: TransferConfig, learner: Learner, teachers: Sequence[Teacher]
) -> Tensor:
    """Return β_k of each teacher for each seed, (M, S), by a schedule or by what was measured."""
    n_seeds = len(learner.seeds)
    if not teachers:
        return torch.zeros(0, n_seeds, dtype=torch.float64)
    if transfer.kickstart_schedule == "auto" and learner.measured:
        found = learner.measured.betas([teacher.cosine for teacher in teachers])
        if k > transfer.iterations or learner.measured.ended:
            found = np.zeros_like(found)
        learner.measured.note(found)
        return torch.from_numpy(found)
    coefs = schedules.kickstart_coefs(k, transfer, len(teachers))
    return torch.tensor(coefs, dtype=torch.float64).unsqueeze(1).expand(-1, n_seeds)


def _own_samples(student: ActorCritic, rollout: Rollout, ppo: PPOConfig) -> Samples:
    """Return the student's samples, after its normaliser has seen what it saw."""
    samples = to_samples(rollout, student.value, ppo)
    if not student.normalizer and ppo.objective != "trpo":
        return samples
    policy = describe(student.policy, samples)
    if student.normalizer:  # new statistics make a new π_old: the first ratio is to be 1
        samples = replace(samples, behavior_log_probs=policy.log_prob(samples.actions))
    return replace(samples, behavior=policy if ppo.objective == "trpo" else None)


def _prepared(samples: Samples, ppo: PPOConfig) -> Samples:
    """Return the student's samples with Â standardised, and no more of them than asked for."""
    scaled = standardize(samples, moments(samples))
    return scaled.first(ppo.n_steps) if ppo.whole_episodes and ppo.n_steps else scaled


def _fit(
    task: TaskCard,
    learner: Learner,
    k: int,
    rollout: Rollout,
    batch: Samples,
    phase: schedules.Phase,
    **options: Any,
) -> dict[str, np.ndarray]:
    """Take the gradient steps of an on-policy iteration.

    Both at once, with advantages from before the critic's fit; or the critic first, then
    advantages, then the policy, as algorithms 1 and 2 write; or the critic alone.
    """
    student, ppo = learner.student, task.ppo

    def learn(samples: Samples, parts: Parts) -> dict[str, np.ndarray]:
        return learn_on_policy(
            student, learner.optimizer, samples, ppo, _shuffles(learner, k), parts=parts, **options
        )

    if phase == "critic":
        return learn(batch, "critic")
    if ppo.advantages == "before":
        return learn(batch, "both")
    numbers = learn(batch, "critic")
    judged = _prepared(to_samples(rollout, student.value, ppo), ppo)
    return numbers | learn(replace(batch, advantages=judged.advantages), "policy")


def episode_numbers(rollout: Rollout, n_seeds: int) -> dict[str, np.ndarray]:
    """Return each seed's mean return and length of the episodes that ended, nan of none, (S,)."""
    seeds, returns, lengths = rollout.episodes()
    ended = np.bincount(seeds, minlength=n_seeds)
    with np.errstate(invalid="ignore"):
        return {
            "episode_return": np.bincount(seeds, returns, n_seeds) / ended,
            "episode_length": np.bincount(seeds, lengths, n_seeds) / ended,
        }


def without_sights(rollout: Rollout) -> Rollout:
    """Return a rollout without its observations, which fill memory and no table."""
    return replace(rollout, frames=Frames([]))


def _shuffles(learner: Learner, k: int) -> list[np.random.Generator]:
    return [generator(seed, Purpose.SHUFFLE, k) for seed in learner.seeds]


def _explained_variance(samples: Samples) -> torch.Tensor:
    """Return 1 − Var(R̂ − V) / Var(R̂), (S,): how much of the returns the critic knew beforehand."""
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
