"""Q-learning with instance transfer: teachers help to fill its memory (paper, appendix A).

The policy's network holds Q(s, a) where a policy would have logits, so that its most likely action
is the best one: it is evaluated, kept and shown like any other. The critic's network stands still.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
import torch
from torch import Tensor

from repaint_cli.config import QLearningConfig
from repaint_cli.distributions import Categorical, Distribution
from repaint_cli.errors import CardError, DivergedError, telling_where
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.losses import squared_error
from repaint_cli.learn.objectives import mean_over
from repaint_cli.learn.rollout import Policy
from repaint_cli.learn.seeding import Purpose, generator
from repaint_cli.learn.tape import Rollout
from repaint_cli.learn.teachers import Teacher, soften
from repaint_cli.learn.trainer import IterationStats, episode_numbers, without_sights
from repaint_cli.learn.transitions import Transitions, transitions
from repaint_cli.learn.update import Means
from repaint_cli.nets import ActorCritic
from repaint_cli.spaces import Spaces
from repaint_cli.tasks import TaskCard


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
    memory, target = _Memory(task.q_learning.memory), _twin(learner.student)
    for k in range(learner.iteration + 1, task.ppo.n_iterations + 1):
        started, before = perf_counter(), learner.env_steps.copy()
        taught = k <= task.transfer.iterations and task.transfer.instance > 0
        with telling_where(learner.seeds, f"iteration {k}"):
            acting = [teacher for teacher in teachers if teacher.acts] if taught else []
            policy = epsilon_greedy(learner.student, epsilon(k, task.q_learning))
            rollout = learner.act(task, k, policy, beside=len(acting))
            learner.see(rollout)
            memory.add(rollout, from_teacher=False)
            for i, teacher in enumerate(acting):
                policy = soften(teacher.network, task.transfer)
                watched = learner.watch(task, k, policy, which=i, of=len(acting), beside=1)
                memory.add(watched, from_teacher=True)
            numbers = _learn(task, learner, memory.all, target, k, selecting=bool(acting))
        learner.iteration = k
        taken, seconds = learner.env_steps - before, perf_counter() - started
        numbers |= episode_numbers(rollout, learner.student.n_seeds)
        numbers["epsilon"] = np.full(taken.shape, epsilon(k, task.q_learning))
        numbers["env_steps"] = learner.env_steps.copy()
        numbers["steps_per_second"] = np.full(taken.shape, taken.sum() / seconds)
        yield IterationStats(k, "instance" if acting else "ppo", numbers, without_sights(rollout))


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


@dataclass(frozen=True)
class Experience(Transitions):
    """Transitions that remember who made them."""

    from_teacher: Tensor
    """Whether a teacher acted, (S, B) bool."""


class _Memory:
    """The replay buffer: the newest iterations, each whole."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._batches: list[Experience] = []

    def add(self, rollout: Rollout, from_teacher: bool) -> None:
        """Keep a rollout, and forget the oldest while there is too much."""
        found = transitions(rollout)
        who = torch.full(found.rows.shape, from_teacher)
        self._batches.append(Experience(**vars(found), from_teacher=who))
        while sum(int(batch.counts.max()) for batch in self._batches[1:]) >= self._size:
            del self._batches[0]
        self.all = Experience.together(self._batches)


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
    rngs = [generator(seed, Purpose.SHUFFLE, k) for seed in learner.seeds]
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
