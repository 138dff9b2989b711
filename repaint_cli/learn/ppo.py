"""The loop of algorithms 1 and 2; it yields what happened and knows no files and no screen."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np
import torch

from repaint_cli.errors import DivergedError, locate_divergence
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.on_policy import own_iteration
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.transfer import schedules
from repaint_cli.learn.transfer.teachers import Teacher, actors, transfer_instances
from repaint_cli.learn.update.epochs import learn_from_instances
from repaint_cli.tasks.card import TaskCard


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
    steps: float = 0.0
    """Environment steps of a seed in it, on average."""


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
        phase = phase_of(k, task, learner, teachers) if teachers else "ppo"
        now = task.model_copy(update={"ppo": schedules.ppo(k, task.ppo)})
        learner.optimizer.learning_rate = now.ppo.learning_rate
        with locate_divergence(learner.seeds, f"iteration {k}"):
            rollout = None
            if phase == "instance":
                numbers = _instance_iteration(now, learner, k, teachers)
            else:
                numbers, rollout = own_iteration(now, learner, k, teachers, phase)
                if phase == "representation" and not numbers["kickstart_coef"].any():
                    phase = "ppo"  # nobody had anything to say
            _check_weights(learner)
        yield finished(learner, k, phase, numbers, rollout, before, perf_counter() - started)


def phase_of(
    k: int, task: TaskCard, learner: Learner, teachers: Sequence[Teacher]
) -> schedules.Phase:
    """Return what iteration k does: by R and I, or by what was measured."""
    phase, transfer = schedules.phase(k, task.transfer), task.transfer
    if not learner.measured or phase == "critic" or k > transfer.iterations:
        return phase
    if learner.measured.ended:
        return "ppo"
    if transfer.phases == "auto" and phase != "joint":
        may = k > 1 + transfer.critic_warmup and not learner.after_instance
        wanted = may and learner.measured.instance_next() and actors(teachers, task, learner)
        return "instance" if wanted else "representation"
    if phase == "instance" and not actors(teachers, task, learner):
        return "representation"
    return phase


def _instance_iteration(
    task: TaskCard, learner: Learner, k: int, teachers: Sequence[Teacher]
) -> dict[str, np.ndarray]:
    """Let teachers act and the student learn from the best of it (algorithm 2, even k)."""
    kept, numbers = transfer_instances(task, learner, teachers, k)
    _, alpha_2 = schedules.alphas(k, task.transfer)
    return numbers | learn_from_instances(
        learner.student, learner.optimizer, kept, task.ppo, learner.shuffles(k), alpha_2
    )


def finished(
    learner: Learner,
    k: int,
    phase: schedules.Phase,
    numbers: dict[str, np.ndarray],
    rollout: Rollout | None,
    before: np.ndarray,
    seconds: float,
) -> IterationStats:
    """Count an iteration and return what it did.

    Args:
        learner: who learned.
        k: the iteration.
        phase: what it was.
        numbers: what is worth telling, (S,) each.
        rollout: how the students drove, if they did.
        before: environment steps before it, (S,).
        seconds: how long it took.
    """
    learner.iteration, learner.after_instance = k, phase == "instance"
    taken = learner.env_steps - before
    told = numbers | {
        "env_steps": learner.env_steps.copy(),
        "steps_per_second": np.full(taken.shape, taken.sum() / seconds),
    }
    return IterationStats(k, phase, told, rollout, float(taken.mean()))


def _check_weights(learner: Learner) -> None:
    finite = torch.isfinite(learner.student.storage).all(1)
    if not finite.all():
        raise DivergedError(
            "expected finite weights after the last step, found some that are not; "
            "a smaller ppo.learning_rate may help",
            row=int((~finite).nonzero()[0]),
        )
