"""Q-learning with instance transfer: teachers help to fill the replay buffer (paper, appendix A).

The policy's network holds Q(s, a) where a policy would have logits, so that its most likely action
is the best one: it is evaluated, saved and shown like any other. The critic is not trained.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from repaint_cli.activity import advance, doing, progress
from repaint_cli.errors import CardError, locate_divergence
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.rollout.collect import Policy
from repaint_cli.learn.rollout.observations import Observations, each
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.rollout.transitions import Experience, flat, transitions
from repaint_cli.learn.side_by_side import check
from repaint_cli.learn.stats import IterationStats, Meter
from repaint_cli.learn.transfer import schedules
from repaint_cli.learn.transfer.course import Course
from repaint_cli.learn.transfer.schedules import Phase
from repaint_cli.learn.transfer.teachers import ActingTeacher, soften
from repaint_cli.learn.update.adam import RowAdam
from repaint_cli.learn.update.epochs import seed_by_seed
from repaint_cli.learn.update.losses import squared_error
from repaint_cli.learn.update.means import Means
from repaint_cli.learn.update.objectives import mean_over
from repaint_cli.policies.devices import HOST
from repaint_cli.policies.distributions import Categorical, Distribution
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.spaces import Spaces
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.transfer_settings import QLearningConfig


def train(card: TaskCard, learner: Learner, course: Course) -> Iterator[IterationStats]:
    """Learn Q until the card's number of iterations, yielding after each; see `ppo.train`.

    In the first K iterations the teachers act, too, and of their samples only those with
    y − Q > ζ are learned from; later ones are ordinary entries of the buffer.

    Raises:
        CardError: the task has continuous actions, or cannot be rolled out as its card says.
        DivergedError: an observation, a reward or a loss is not finite.
    """
    card.check_rollout()
    check_actions(card, learner.student.spaces)
    target = _target_network(learner.student)
    for k in range(learner.iteration + 1, card.ppo.n_iterations + 1):
        meter = Meter(learner)
        learner.optimizer.learning_rate = schedules.learning_rate(k, card.ppo)
        taught = k <= card.transfer.iterations and card.transfer.instance > 0
        actors = course.actors() if taught else []
        with locate_divergence(learner.seeds, f"iteration {k}"):
            rollout, batches = _collect(card, learner, k, actors)
            learner.memory = extended(learner.memory, batches, card.q_learning.memory)
            with doing("learning"):
                memory = learner.memory.to(learner.student.device)
                metrics = _learn(card, learner, memory, target, k, selecting=bool(actors))
        metrics["episode_return"], metrics["episode_length"] = rollout.mean_episodes()
        metrics["epsilon"] = np.full(len(learner.seeds), epsilon(k, card.q_learning))
        phase: Phase = "instance" if actors else "ppo"
        learner.iteration = k
        course.finish(phase)
        yield meter.stats(phase, metrics, rollout.without_observations())


def _collect(
    card: TaskCard, learner: Learner, k: int, actors: Sequence[ActingTeacher]
) -> tuple[Rollout, list[Experience]]:
    """Let the students act ε-greedily, and the teachers beside them.

    Returns:
        The students' rollout, and the transitions of all.
    """
    policy = epsilon_greedy(learner.student, epsilon(k, card.q_learning))
    rollout = learner.collect(card, k, policy, n_teachers=len(actors))
    learner.update_normalizer(rollout)
    batches = [_experience(card, rollout, from_teacher=False)]
    for actor in actors:
        policy = soften(actor.teacher.network, card.transfer)
        taught = learner.collect_teacher(
            card, k, policy, which=actor.which, of=actor.of, student_acts=True
        )
        batches.append(_experience(card, taught, from_teacher=True))
        if card.transfer.teacher_statistics:
            learner.update_normalizer(taught)
    return rollout, batches


def check_actions(card: TaskCard, spaces: Spaces) -> None:
    """Check that a task's actions are numbered, and that evaluations take the best.

    Raises:
        CardError: the actions are continuous, or of several numbers, or evaluations draw them.
    """
    if card.eval.actions != "likeliest":
        raise CardError("expected eval.actions 'likeliest' for q-learning, found 'sampled'")
    if not spaces.discrete or spaces.sizes:
        raise CardError(f"expected numbered actions for q-learning, found {spaces}")


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


def _experience(card: TaskCard, rollout: Rollout, from_teacher: bool) -> Experience:
    """Return a rollout's transitions, marked by whether a teacher acted."""
    batch = transitions(rollout)
    ends = batch.terminations
    if card.ppo.time_limit == "terminal":
        ends = ends | flat(rollout, rollout.truncations)
    marks = torch.full(batch.rows.shape, from_teacher)
    whole = Experience(**vars(batch) | {"terminations": ends}, from_teacher=marks)
    return whole.to(HOST)


def extended(memory: Experience | None, batches: Sequence[Experience], size: int) -> Experience:
    """Return the replay buffer with new batches in it, but of each seed no more than its newest."""
    whole = Experience.concatenate([*([memory] if memory else []), *batches])
    starts = (whole.counts - size).clamp(min=0)
    counts = whole.counts - starts
    positions = torch.arange(int(counts.max())) + starts.unsqueeze(1)
    newest = whole.pick(positions.clamp(max=whole.rows.shape[1] - 1), counts)
    first = newest.rows[:, :1]  # rows grow: observations before it are not needed any more
    stores = [
        each(lambda array, row: array[row:].clone(), store, row)
        for store, row in zip(newest.observations.stores, first[:, 0].tolist(), strict=True)
    ]
    rows, next_rows = ((column - first).clamp(min=0) for column in (newest.rows, newest.next_rows))
    return replace(newest, observations=Observations(stores), rows=rows, next_rows=next_rows)


def _target_network(student: ActorCritic) -> ActorCritic:
    """Return a network of the same shape with the same normaliser."""
    target = ActorCritic(student.spaces, student.net, student.n_seeds, student.device)
    target.normalizer = student.normalizer
    return target


def _learn(
    card: TaskCard,
    learner: Learner,
    memory: Experience,
    target: ActorCritic,
    k: int,
    selecting: bool,
) -> dict[str, np.ndarray]:
    """Take an iteration's gradient steps; see `q_loss`."""
    student, optimizer, rngs = learner.student, learner.optimizer, learner.shuffles(k)
    threshold = card.q_learning.threshold if selecting else None
    target.storage.copy_(student.storage)
    n_steps, image = card.q_learning.gradient_steps, student.spaces.image
    if card.ppo.stacked and not image:
        progress(0, n_steps, "batches")
        return _take_steps(card, student, optimizer, memory, target, threshold, rngs)
    progress(0, n_steps * student.n_seeds, "batches")

    def steps(s: int) -> dict[str, np.ndarray]:
        return _take_steps(
            card, student.alone(s), optimizer.alone(s), memory.alone(s), target.alone(s),
            threshold, [rngs[s]],
        )  # fmt: skip

    return seed_by_seed([steps], student.n_seeds, image)


def _take_steps(
    card: TaskCard,
    student: ActorCritic,
    optimizer: RowAdam,
    memory: Experience,
    target: ActorCritic,
    threshold: float | None,
    rngs: Sequence[np.random.Generator],
) -> dict[str, np.ndarray]:
    """Take the steps of all seeds together, in minibatches (S, b) of each seed's own memory."""
    frozen, size, means = [False] * student.n_seeds, card.ppo.minibatch_size, Means()
    for _ in range(card.q_learning.gradient_steps):
        drawn = [rng.integers(n, size=size) for rng, n in zip(rngs, memory.counts, strict=True)]
        positions = torch.from_numpy(np.stack(drawn))
        batch = memory.pick(positions, torch.full((len(rngs),), size))
        loss, counts, metrics = q_loss(student, target, batch, card.ppo.gamma, threshold)
        means.watch(loss, {"value_loss": loss})
        student.gradients.zero_()
        torch.autograd.backward(loss.sum())
        optimizer.step((counts > 0).tolist(), frozen, 1.0, card.ppo.max_grad_norm)
        means.add(counts, metrics)
        advance()
        check()
    means.check_finite()
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
        The losses, how many samples each is of, and metrics, (S,) each.
    """
    counts, observations = batch.counts, batch.observations
    with torch.no_grad():
        following = target.q_values(observations.take(batch.next_rows), counts).amax(-1)
        targets = batch.rewards + gamma * following.where(~batch.terminations, 0.0)
    q_values = student.q_values(observations.take(batch.rows), counts)
    values = q_values.gather(-1, batch.actions.unsqueeze(-1)).squeeze(-1)
    selected = torch.ones_like(batch.from_teacher)
    if threshold is not None:
        selected = ~batch.from_teacher | (targets - values.detach() > threshold)
    total = selected.sum(1)
    error = (squared_error(values, targets) * selected).sum(1) / total.clamp(min=1)
    metrics = {"value_loss": error, "q_value": mean_over(counts, values)(values)}
    if threshold is None:
        return error / 2, counts, metrics
    share = (selected & batch.from_teacher).sum(1) / batch.from_teacher.sum(1)
    return error / 2, total, metrics | {"kept_fraction": share.nan_to_num(0.0)}
