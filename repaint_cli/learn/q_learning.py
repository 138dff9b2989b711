"""Q-learning with instance transfer: teachers help to fill its memory (paper, appendix A).

The policy's network holds Q(s, a) where a policy would have logits, so that its most likely action
is the best one: it is evaluated, kept and shown like any other. The critic's network stands still.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np
import torch
from torch import Tensor

from repaint_cli.errors import CardError, DivergedError, locate_divergence
from repaint_cli.learn.learner import Learner, without_sights
from repaint_cli.learn.ppo import IterationStats, finished
from repaint_cli.learn.rollout.collect import Policy
from repaint_cli.learn.rollout.observations import Frames, each
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.rollout.transitions import Experience, flat, transitions
from repaint_cli.learn.transfer import schedules
from repaint_cli.learn.transfer.schedules import Phase
from repaint_cli.learn.transfer.teachers import Teacher, soften
from repaint_cli.learn.update.epochs import Means
from repaint_cli.learn.update.losses import squared_error
from repaint_cli.learn.update.objectives import mean_over
from repaint_cli.policies.distributions import Categorical, Distribution
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.spaces import Spaces
from repaint_cli.settings import QLearningConfig
from repaint_cli.tasks.card import TaskCard


def train(
    task: TaskCard, learner: Learner, teachers: Sequence[Teacher] = ()
) -> Iterator[IterationStats]:
    """Learn Q until the task's number of iterations, yielding after each; see `trainer.train`.

    In the first K iterations the teachers act, too, and of their samples only those with
    y − Q > ζ are learned from; later ones are ordinary entries of the buffer.

    Raises:
        CardError: the task has continuous actions, or cannot be rolled out as its card says.
        DivergedError: an observation, a reward or a loss is not finite.
    """
    task.check_rollout()
    check(task, learner.student.spaces)
    target = _twin(learner.student)
    for k in range(learner.iteration + 1, task.ppo.n_iterations + 1):
        started, before = perf_counter(), learner.env_steps.copy()
        learner.optimizer.learning_rate = schedules.ppo(k, task.ppo).learning_rate
        taught = k <= task.transfer.iterations and task.transfer.instance > 0
        acting = [teacher for teacher in teachers if teacher.acts] if taught else []
        with locate_divergence(learner.seeds, f"iteration {k}"):
            rollout, watched = _act(task, learner, k, acting)
            made = [(rollout, False), *((one, True) for one in watched)]
            experience = [_experience(task, *pair) for pair in made]
            learner.memory = remembered(learner.memory, experience, task.q_learning.memory)
            numbers = _learn(task, learner, learner.memory, target, k, selecting=bool(acting))
        numbers["episode_return"], numbers["episode_length"] = rollout.mean_episodes()
        numbers["epsilon"] = np.full(len(learner.seeds), epsilon(k, task.q_learning))
        phase: Phase = "instance" if acting else "ppo"
        seconds = perf_counter() - started
        yield finished(learner, k, phase, numbers, without_sights(rollout), before, seconds)


def _act(
    task: TaskCard, learner: Learner, k: int, acting: Sequence[Teacher]
) -> tuple[Rollout, list[Rollout]]:
    """Let the students act ε-greedily, and the teachers beside them; return the rollouts."""
    policy = epsilon_greedy(learner.student, epsilon(k, task.q_learning))
    rollout = learner.act(task, k, policy, beside=len(acting))
    learner.see(rollout)
    watched = []
    for i, teacher in enumerate(acting):
        policy = soften(teacher.network, task.transfer)
        watched.append(learner.watch(task, k, policy, which=i, of=len(acting), beside=1))
        if task.transfer.teacher_statistics:
            learner.see(watched[-1])
    return rollout, watched


def check(task: TaskCard, spaces: Spaces) -> None:
    """Check that a task's actions have numbers.

    Raises:
        CardError: they have not.
    """
    if not spaces.discrete:
        raise CardError(
            f"expected numbered actions for q-learning, found {spaces} in '{task.name}'"
        )


def epsilon(k: int, config: QLearningConfig) -> float:
    """Return ε of iteration k, which falls in a straight line and stays."""
    done = min(1.0, (k - 1) / config.epsilon_iterations)
    return config.first_epsilon + done * (config.last_epsilon - config.first_epsilon)


def epsilon_greedy(student: ActorCritic, epsilon: float) -> Policy:
    """Return the policy that takes the best action, and with probability ε any."""

    def act(obs: Any, counts: Sequence[int]) -> Distribution:
        values = student.q_values(obs, counts)  # (S, B, A)
        chances = torch.full_like(values, epsilon / values.shape[-1])
        best = values.argmax(-1, keepdim=True)
        return Categorical(chances.scatter(-1, best, chances[..., :1] + 1 - epsilon).log())

    return act


def _experience(task: TaskCard, rollout: Rollout, from_teacher: bool) -> Experience:
    """Return a rollout's transitions, with who made them."""
    found = transitions(rollout)
    over = found.terminations
    if task.ppo.time_limit == "terminal":
        over = over | flat(rollout, rollout.truncations)
    who = torch.full(found.rows.shape, from_teacher)
    return Experience(**vars(found) | {"terminations": over}, from_teacher=who)


def remembered(memory: Experience | None, batches: Sequence[Experience], size: int) -> Experience:
    """Return the replay buffer with new batches in it, but of each seed no more than its newest."""
    whole = Experience.together([*([memory] if memory else []), *batches])
    starts = (whole.counts - size).clamp(min=0)
    counts = whole.counts - starts
    reach = torch.arange(int(counts.max())) + starts.unsqueeze(1)
    kept = whole.pick(reach.clamp(max=whole.rows.shape[1] - 1), counts)
    first = kept.rows[:, :1]  # rows grow: what lies before is not looked at any more
    stores = [
        each(lambda part, row: part[row:].clone(), store, row)
        for store, row in zip(kept.frames.stores, first[:, 0].tolist(), strict=True)
    ]
    rows, following = ((part - first).clamp(min=0) for part in (kept.rows, kept.next_rows))
    return replace(kept, frames=Frames(stores), rows=rows, next_rows=following)


def _twin(student: ActorCritic) -> ActorCritic:
    """Return a network of the same shape that sees through the same normaliser."""
    twin = ActorCritic(student.spaces, student.net, student.n_seeds)
    twin.normalizer = student.normalizer
    return twin


def _learn(
    task: TaskCard,
    learner: Learner,
    memory: Experience,
    target: ActorCritic,
    k: int,
    selecting: bool,
) -> dict[str, np.ndarray]:
    """Take an iteration's gradient steps; see `q_loss`."""
    student, config, means = learner.student, task.q_learning, Means()
    rngs = learner.shuffles(k)
    still, size = [False] * student.n_seeds, task.ppo.minibatch_size
    threshold = config.threshold if selecting else None
    target.storage.copy_(student.storage)
    for _ in range(config.gradient_steps):
        drawn = [rng.integers(n, size=size) for rng, n in zip(rngs, memory.counts, strict=True)]
        positions = torch.from_numpy(np.stack(drawn))
        batch = memory.pick(positions, torch.full((len(rngs),), size))
        loss, kept, numbers = q_loss(student, target, batch, task.ppo.gamma, threshold)
        lost = ~torch.isfinite(loss)
        if lost.any():
            row = int(lost.nonzero()[0])
            raise DivergedError.of_loss("value_loss", loss[row].item(), row)
        student.gradients.zero_()
        torch.autograd.backward(loss.sum())
        learner.optimizer.step((kept > 0).tolist(), still)
        means.add(kept, numbers)
    return means.numpy()


def q_loss(
    student: ActorCritic,
    target: ActorCritic,
    batch: Experience,
    gamma: float,
    threshold: float | None,
) -> tuple[Tensor, Tensor, dict[str, Tensor]]:
    """Return ½·(Q_φ(s, a) − y)² of each seed, (S,), its mean over what is learned from.

        y = r + γ·max_a′ Q(s′, a′)      0 beyond a terminal state; Q of the target network

    Args:
        student: Q_φ.
        target: the network behind y.
        batch: from the buffer, (S, b).
        gamma: γ.
        threshold: ζ: of a teacher's samples only those with y − Q > ζ count; None keeps all.

    Returns:
        The losses, how many samples each is of, and what is worth telling.
    """
    counts = batch.counts.tolist()
    with torch.no_grad():
        following = target.q_values(batch.frames.take(batch.next_rows), counts).amax(-1)
        wanted = batch.rewards + gamma * following.where(~batch.terminations, 0.0)
    values = student.q_values(batch.frames.take(batch.rows), counts)
    found = values.gather(-1, batch.actions.unsqueeze(-1)).squeeze(-1)
    kept = torch.ones_like(batch.from_teacher)
    if threshold is not None:
        kept = ~batch.from_teacher | (wanted - found.detach() > threshold)
    total = kept.sum(1)
    error = (squared_error(found, wanted) * kept).sum(1) / total.clamp(min=1)
    taught = batch.from_teacher.sum(1)
    share = (kept & batch.from_teacher).sum(1) / taught
    mean = mean_over(batch.counts, found.shape[1])
    numbers = {"value_loss": error, "q_value": mean(found)}
    if threshold is not None:
        numbers["kept_fraction"] = share.nan_to_num(0.0)
    return error / 2, total, numbers
