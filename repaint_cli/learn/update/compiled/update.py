"""The updates of `update` for small dense networks, with derivatives by hand, compiled.

Same samples, same order, same numbers to rounding: `tests/test_by_hand.py` holds the two together.
A seed's policy and critic share nothing, so each is a job of its own, and jobs share the cores.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from typing import Literal

import numpy as np
import torch
from threadpoolctl import ThreadpoolController
from torch import Tensor

from repaint_cli.errors import DivergedError
from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.learn.update.adam import RowAdam
from repaint_cli.learn.update.compiled.kernels import (
    POLICY_NUMBERS,
    Batch,
    Choices,
    learn_policy,
    learn_value,
)
from repaint_cli.learn.update.compiled.views import Place
from repaint_cli.policies.distributions import Categorical, Distribution, Gaussian
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.settings import PPOConfig

Parts = Literal["both", "policy", "critic"]
"""Who moves in an update."""

_Job = Callable[[], int]
"""Takes all steps of a policy or a critic and returns how many those were."""


def applies_to(student: ActorCritic, ppo: PPOConfig) -> bool:
    """Tell whether a student's networks are dense with tanh, and the loss is the one here."""
    dense = student.net.kind == "mlp" and student.net.activation == "tanh"
    return ppo.compiled and dense and ppo.objective == "clipped"


def learn(
    student: ActorCritic,
    optimizer: RowAdam,
    samples: Samples,
    ppo: PPOConfig,
    rngs: Sequence[np.random.Generator],
    *,
    teacher: Distribution | None = None,
    beta: Tensor | float = 0.0,
    scale: float = 1.0,
    parts: Parts = "both",
    instances: bool = False,
) -> dict[str, np.ndarray]:
    """Take every step of `learn_on_policy`, or of `learn_from_instances`.

    Args:
        student: who learns; its networks are dense, with tanh.
        optimizer: its optimiser.
        samples: of the student, or selected ones of the teacher.
        ppo: epochs, minibatches and coefficients.
        rngs: one generator per seed for the order of the samples.
        teacher: the teacher's distributions at the samples, for the cross-entropy.
        beta: β_k, of all seeds or (S,).
        scale: of the policies' learning rate.
        parts: who moves, policies, critics or both.
        instances: whether the samples are a teacher's: only policies move, without entropy bonus.

    Returns:
        Each seed's mean losses and diagnostics, (S,) each.

    Raises:
        DivergedError: a loss is not finite; unlike in the plain update, which stops at once, the
            other seeds have learned on.
    """
    assert student.normalizer is not None
    counts = samples.counts.tolist()
    obs = student.normalizer.normalize(samples.frames.take(samples.rows)).numpy()
    actions, advised, spreads = _choices(student, samples, teacher)
    n_steps = ppo.n_epochs * -(-max(counts) // ppo.minibatch_size)
    told, judged = (np.zeros((len(counts), n_steps, n)) for n in (len(POLICY_NUMBERS), 1))
    policies, critics = list[_Job](), list[_Job]()
    betas = torch.as_tensor(beta).expand(len(counts))
    for s, (n, rng) in enumerate(zip(counts, rngs, strict=True)):
        order = np.stack([rng.permutation(n) for _ in range(ppo.n_epochs)])
        batch = Batch(obs[s], order, max(1, min(ppo.minibatch_size, n)))
        choices = Choices(
            student.spaces.discrete, actions[s], samples.behavior_log_probs[s].numpy(),
            samples.advantages[s].numpy(), advised[s], spreads[s], ppo.clip_range,
            0.0 if instances else ppo.ent_coef, 0.0 if teacher is None else float(betas[s]),
        )  # fmt: skip
        place, returns = Place(student, optimizer, s, scale), samples.returns[s].numpy()
        policies.append(partial(_policy_steps, place, batch, choices, told[s]))
        place = Place(student, optimizer, s, 1.0)
        critics.append(partial(_value_steps, place, batch, returns, ppo.vf_coef, judged[s]))
    jobs = {"both": policies + critics, "policy": policies, "critic": critics}[
        "policy" if instances else parts
    ]
    with _blas().limit(limits=1), ThreadPoolExecutor(torch.get_num_threads()) as pool:
        steps = list(pool.map(lambda job: job(), jobs))
    numbers = _means(np.concatenate([told, judged], 2), np.array(steps[: len(counts)]))
    return _as_plain(numbers, instances, teacher is not None, parts)


def _policy_steps(place: Place, batch: Batch, choices: Choices, told: np.ndarray) -> int:
    if choices.discrete:
        log_std = slope = np.zeros(0, np.float32)
    else:
        log_std, slope = place.leaf("policy.log_std")
    tower, row = place.tower("policy", batch.size), place.row(0)
    steps = learn_policy(tower, row, log_std, slope, batch, choices, told)
    place.optimizer.steps[0, place.s] += steps
    return steps


def _value_steps(
    place: Place, batch: Batch, returns: np.ndarray, vf_coef: float, told: np.ndarray
) -> int:
    tower, row = place.tower("value", batch.size), place.row(1)
    steps = learn_value(tower, row, batch, returns, vf_coef, told)
    place.optimizer.steps[1, place.s] += steps
    return steps


def _choices(
    student: ActorCritic, samples: Samples, teacher: Distribution | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return actions, one-hot where discrete, and the teacher's mean and log σ, (S, B, A) each."""
    actions, n_actions = samples.actions, student.spaces.n_actions
    if student.spaces.discrete:
        actions = torch.nn.functional.one_hot(actions, n_actions).float()
    advised = spreads = torch.zeros_like(actions)
    if isinstance(teacher, Gaussian):
        advised, spreads = teacher.mean, teacher.log_std.expand_as(teacher.mean).contiguous()
    elif isinstance(teacher, Categorical):
        advised = teacher.log_probs
    return actions.numpy(), advised.numpy(), spreads.numpy()


@cache
def _blas() -> ThreadpoolController:
    """Return a handle on what compiled code multiplies with, whose own threads would fight ours."""
    import scipy.linalg.cython_blas  # noqa: F401  numba calls it; a library not yet loaded has no handle

    return ThreadpoolController().select(user_api="blas")


def _means(told: np.ndarray, steps: np.ndarray) -> dict[str, np.ndarray]:
    """Return each seed's means over its steps, (S,) each, nan of none; told is (S, steps, 7).

    Raises:
        DivergedError: one of them is not finite.
    """
    names = (*POLICY_NUMBERS, "value_loss")
    lost = ~np.isfinite(told)
    lost[..., 3:6] = False  # these are no parts of a loss
    if lost.any():
        row, step, column = np.argwhere(lost)[0]
        raise DivergedError.of_loss(names[column], told[row, step, column], int(row))
    with np.errstate(invalid="ignore", over="ignore"):
        means = (told.sum(1) / steps[:, None]).astype(np.float32)  # (S, 7)
    return dict(zip(names, means.T, strict=True))


def _as_plain(
    numbers: dict[str, np.ndarray], instances: bool, teacher: bool, parts: Parts
) -> dict[str, np.ndarray]:
    """Return the numbers that the plain update would tell, by their names there."""
    if instances:
        kept = ("policy_loss", "approx_kl", "clip_fraction", "log_ratio")
        return {n: numbers[n] for n in kept} | {"kept_clip_fraction": numbers["clip_fraction"]}
    without = {"log_ratio"} if teacher else {"log_ratio", "cross_entropy"}
    return told_by(parts, {name: number for name, number in numbers.items() if name not in without})


def told_by(parts: Parts, numbers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the numbers of those who moved."""
    if parts == "both":
        return numbers
    return {n: told for n, told in numbers.items() if (n == "value_loss") == (parts == "critic")}
