"""The loop of algorithms 1 and 2; it yields what happened and knows no files and no screen."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
import torch

from repaint_cli.config import PPOConfig, TransferConfig
from repaint_cli.errors import DivergedError, telling_where
from repaint_cli.learn import schedules
from repaint_cli.learn.advantages import Samples, describe, to_samples
from repaint_cli.learn.frames import Frames
from repaint_cli.learn.optimizer import RowAdam
from repaint_cli.learn.rollout import Policy, collect, start
from repaint_cli.learn.seeding import Purpose, generator
from repaint_cli.learn.selection import (
    Moments,
    above_threshold,
    moments,
    rescale,
    standardize,
)
from repaint_cli.learn.tape import Rollout
from repaint_cli.learn.update import (
    learn_from_instances,
    learn_on_policy,
    masked_mean,
)
from repaint_cli.nets import ActorCritic
from repaint_cli.tasks import TaskCard


@dataclass
class Learner:
    """All that changes while S seeds learn; what a checkpoint holds."""

    student: ActorCritic
    """The policies and critics."""
    optimizer: RowAdam
    """Their optimiser."""
    seeds: list[int]
    """The run seeds, (S,)."""
    iteration: int
    """Finished iterations."""
    env_steps: np.ndarray
    """Steps taken for training, the teacher's among them, (S,)."""
    last_moments: Moments
    """Mean and standard deviation of Â in each student's last own batch, (S, 1) each; where ζ is
    meant on their scale, by the critic that will judge the teacher's samples."""
    last_reward: torch.Tensor
    """Mean reward of each student's last own batch, (S,)."""

    @classmethod
    def fresh(cls, student: ActorCritic, seeds: list[int], learning_rate: float) -> "Learner":
        """Start with newly drawn parameters."""
        n = len(seeds)
        student.initialize([generator(seed, Purpose.INITIALIZE) for seed in seeds])
        optimizer = RowAdam(student, learning_rate)
        nothing = (torch.zeros(n, 1), torch.ones(n, 1))
        return cls(student, optimizer, seeds, 0, np.zeros(n, int), nothing, torch.zeros(n))


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
    task: TaskCard, learner: Learner, teacher: ActorCritic | None
) -> Iterator[IterationStats]:
    """Train until the task's number of iterations, yielding after each (paper, algorithms 1 and 2).

    Args:
        task: the target task; its `transfer` says what the teacher contributes, and with β₀ = 0 and
            I = 0 this is clipped PPO.
        learner: where to start from; it is changed in place.
        teacher: the teacher's policy, standing S times, or None.

    Raises:
        CardError: the task cannot be rolled out as its card says.
        DivergedError: an observation, a reward, a loss or a weight is not finite.
    """
    task.check_rollout()
    guide = None if teacher is None else soften(teacher, task.transfer)
    for k in range(learner.iteration + 1, task.ppo.n_iterations + 1):
        started, before = perf_counter(), learner.env_steps.copy()
        phase: schedules.Phase = "ppo"
        with telling_where(learner.seeds, f"iteration {k}"):
            if guide is not None:
                phase = schedules.phase(k, task.transfer)
            rollout = None
            if guide is not None and phase == "instance":
                numbers = _instance_iteration(task, learner, k, guide)
            else:
                numbers, rollout = _on_policy_iteration(task, learner, k, guide)
            _check_weights(learner)
        learner.iteration = k
        taken, seconds = learner.env_steps - before, perf_counter() - started
        numbers["env_steps"] = learner.env_steps.copy()
        numbers["steps_per_second"] = np.full(taken.shape, taken.sum() / seconds)
        yield IterationStats(k, phase, numbers, rollout)


def soften(teacher: ActorCritic, transfer: TransferConfig) -> Policy:
    """Return the teacher with a spread, the same for sampling, log-probs and the cross-entropy.

    A trained teacher is nearly deterministic: its samples would have likelihood ratios near 0 under
    any student, and a clipped surrogate with A > 0 has no gradient there.
    """
    return lambda obs, counts: teacher.policy(obs, counts).soften(
        transfer.teacher_min_std, transfer.teacher_temperature
    )


def transfer_instances(
    task: TaskCard, learner: Learner, guide: Policy, k: int
) -> tuple[Samples, dict[str, np.ndarray]]:
    """Let the teacher act in the target task; keep what is worth learning from (section 4.2).

    Advantages are estimated under the target's reward with the student's critic, which is not
    trained here, and which judged `learner.last_moments` too.

    Returns:
        The kept samples and what the selection looked like, (S,) per number.
    """
    n_episodes = task.transfer.teacher_episodes
    rollout = _collect(task, learner, guide, k, n_episodes, as_teacher=True)
    samples = to_samples(rollout, learner.student.value, task.ppo.gamma, task.ppo.gae_lambda)
    scaled = rescale(samples, task.select.scale, learner.last_moments)
    chosen = above_threshold(scaled.advantages, task.select.threshold)
    raw, counts = samples.keep(chosen), (chosen & samples.mask).sum(1)
    nothing = counts == 0
    numbers = {
        "kept_fraction": counts / samples.counts,
        "kept_advantage": masked_mean(raw.advantages, counts).where(~nothing, torch.nan),
        "kept_reward": masked_mean(raw.rewards, counts).where(~nothing, torch.nan),
        "student_reward": learner.last_reward,
    }
    return scaled.keep(chosen), {name: number.numpy() for name, number in numbers.items()}


def _instance_iteration(
    task: TaskCard, learner: Learner, k: int, guide: Policy
) -> dict[str, np.ndarray]:
    """Let the teacher act and the student learn from the best of it (algorithm 2, even k)."""
    kept, numbers = transfer_instances(task, learner, guide, k)
    return numbers | learn_from_instances(
        learner.student, learner.optimizer, kept, task.ppo, _shuffles(learner, k),
        task.transfer.alpha_2,
    )  # fmt: skip


def _on_policy_iteration(
    task: TaskCard, learner: Learner, k: int, guide: Policy | None
) -> tuple[dict[str, np.ndarray], Rollout]:
    """Let the student act and learn from it: PPO, with the cross-entropy where β_k > 0.

    Args:
        task: the target task.
        learner: who learns.
        k: the iteration; in a joint one (algorithm 1) selected teacher samples join every step.
        guide: the softened teacher, or None.

    Returns:
        The iteration's numbers, (S,) each, and the rollout without its observations.
    """
    student, ppo, transfer = learner.student, task.ppo, task.transfer
    rollout = _collect(task, learner, student.policy, k, ppo.n_episodes)
    samples = _own_samples(student, rollout, ppo)
    explained = _explained_variance(samples)
    learner.last_moments = moments(samples)
    learner.last_reward = masked_mean(samples.rewards, samples.counts)
    beta = schedules.kickstart_coef(k, transfer) if guide else 0.0
    kept, numbers = None, dict[str, np.ndarray]()
    if guide and schedules.phase(k, transfer) == "joint":
        kept, numbers = transfer_instances(task, learner, guide, k)
    numbers |= learn_on_policy(
        student, learner.optimizer, standardize(samples, learner.last_moments), ppo,
        _shuffles(learner, k), beta=beta, instances=kept,
        teacher=describe(guide, samples) if guide and beta > 0 else None,
        alpha_1=transfer.alpha_1 if k <= transfer.iterations else 1.0, alpha_2=transfer.alpha_2,
    )  # fmt: skip
    if guide and task.select.scale == "student-batch" and k < transfer.iterations:
        judged_anew = to_samples(rollout, student.value, ppo.gamma, ppo.gae_lambda)
        learner.last_moments = moments(judged_anew)
    numbers["kickstart_coef"] = np.full(student.n_seeds, beta)
    numbers["explained_variance"] = explained.numpy()
    numbers |= _episode_numbers(rollout, student.n_seeds)
    return numbers, replace(rollout, frames=Frames([]))


def _own_samples(student: ActorCritic, rollout: Rollout, ppo: PPOConfig) -> Samples:
    """Return the student's samples, after its normaliser has seen what it saw."""
    if student.normalizer:
        for seed, store in enumerate(rollout.frames.stores):
            student.normalizer.update(seed, store)
    samples = to_samples(rollout, student.value, ppo.gamma, ppo.gae_lambda)
    if student.normalizer:  # new statistics make a new π_old: the first ratio is to be 1
        log_probs = describe(student.policy, samples).log_prob(samples.actions)
        samples = replace(samples, behavior_log_probs=log_probs)
    return samples


def _episode_numbers(rollout: Rollout, n_seeds: int) -> dict[str, np.ndarray]:
    """Return each seed's mean return and length of the episodes that ended, nan of none, (S,)."""
    seeds, returns, lengths = rollout.episodes()
    ended = np.bincount(seeds, minlength=n_seeds)
    with np.errstate(invalid="ignore"):
        return {
            "episode_return": np.bincount(seeds, returns, n_seeds) / ended,
            "episode_length": np.bincount(seeds, lengths, n_seeds) / ended,
        }


def _collect(
    task: TaskCard,
    learner: Learner,
    policy: Policy,
    k: int,
    n_episodes: int | None,
    *,
    as_teacher: bool = False,
) -> Rollout:
    """Roll a policy out in fresh environments, as many steps or episodes as the card says."""
    by_steps = task.ppo.n_episodes is None
    n_envs = n_episodes if n_episodes and not by_steps else task.ppo.n_envs
    env_purpose = Purpose.TEACHER if as_teacher else Purpose.TRAIN
    act_purpose = Purpose.ACT_AS_TEACHER if as_teacher else Purpose.ACT
    env, obs = start(task, learner.seeds, n_envs, env_purpose, k, one_episode=not by_steps)
    rngs = [generator(seed, act_purpose, k) for seed in learner.seeds]
    rollout = collect(
        env, obs, policy, rngs, n_steps=task.ppo.n_steps if by_steps else None,
        record=() if as_teacher else task.env.records,
    )  # fmt: skip
    env.close()
    learner.env_steps += rollout.valid.sum((0, 2))
    return rollout


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
