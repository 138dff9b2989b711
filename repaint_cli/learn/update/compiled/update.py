"""The update of small dense networks, with derivatives by hand, compiled.

Same samples, same order, same numbers to rounding: `tests/test_compiled.py` compares it with
`epochs`. A seed's policy and critic share nothing, so each is a job of its own, and jobs share the
cores.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch

from repaint_cli import interruption
from repaint_cli.errors import DivergedError
from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.learn.side_by_side import side_by_side
from repaint_cli.learn.update.adam import RowAdam
from repaint_cli.learn.update.compiled.kernels import (
    PolicyData,
    learn_policy,
    learn_value,
)
from repaint_cli.learn.update.compiled.views import adam_view, leaf_view, network_view
from repaint_cli.learn.update.spec import UpdateSpec
from repaint_cli.policies.devices import HOST
from repaint_cli.policies.distributions import Categorical, Gaussian
from repaint_cli.policies.networks import ActorCritic

POLICY_METRIC_NAMES = (
    "policy_loss", "entropy", "cross_entropy", "approx_kl", "clip_fraction", "log_ratio"
)  # fmt: skip
"""What `learn_policy` measures at each of its steps, in this order."""

METRIC_NAMES = (*POLICY_METRIC_NAMES, "value_loss")
"""Those and what `learn_value` measures."""

OF_INSTANCES = ("policy_loss", "approx_kl", "clip_fraction", "log_ratio")
"""The metrics of an update on teacher samples."""


def applies_to(student: ActorCritic, spec: UpdateSpec) -> bool:
    """Tell whether a student's networks are dense with tanh, and the loss is the one here.

    And on the host, whose code this is.
    """
    if student.spaces.sizes or student.device != HOST:  # a compound action, or a GPU
        return False
    dense = student.net.kind == "mlp" and student.net.activation == "tanh"
    clipped = spec.ppo.objective == "clipped" and not spec.ppo.kl_weight
    known = spec.loss == "distillation" or (clipped and spec.instances is None)
    return spec.ppo.compiled and dense and known and not spec.ppo.weight_decay


def take_steps(
    student: ActorCritic,
    optimizer: RowAdam,
    samples: Samples,
    spec: UpdateSpec,
    rngs: Sequence[np.random.Generator],
) -> dict[str, np.ndarray]:
    """Take the gradient steps of an update; see `update.update`.

    Raises:
        DivergedError: a loss is not finite; the seeds whose losses are finite have taken all their
            steps, where the update as written stops all of them at once.
    """
    counts = samples.counts.tolist()
    n_steps = spec.ppo.n_epochs * -(-max(counts) // spec.ppo.minibatch_size)
    of_policy, of_critic = (
        np.zeros((len(counts), n_steps, n)) for n in (len(POLICY_METRIC_NAMES), 1)
    )
    seeds = list(_seeds(student, optimizer, samples, spec, rngs))
    jobs = list[Callable[[], int]]()
    if spec.moves_policy:
        data = _policy_data(student, samples, spec)
        jobs += [partial(_policy_steps, seed, data[seed.s], of_policy[seed.s]) for seed in seeds]
    if spec.moves_critic:
        returns = samples.returns.numpy()
        jobs += [partial(_value_steps, seed, returns[seed.s], of_critic[seed.s]) for seed in seeds]
    done = np.array(side_by_side(jobs)).reshape(-1, len(counts))  # of policies, then of critics
    interruption.check()
    steps = np.concatenate([np.repeat(done[:1], of_policy.shape[2], 0), done[-1:]])
    means = _means(np.concatenate([of_policy, of_critic], 2), steps.T)
    return _as_written(means, spec)


@dataclass(frozen=True)
class _Seed:
    """One of the seeds that learn, and what its policy and its critic have in common."""

    student: ActorCritic
    optimizer: RowAdam
    spec: UpdateSpec
    s: int
    """Its number, from 0."""
    obs: np.ndarray
    """Its normalised observations, (n, O)."""
    orders: np.ndarray
    """The order of its samples in each epoch, (epochs, n)."""

    @property
    def size(self) -> int:
        """Samples of a minibatch, no more than there are."""
        return max(1, min(self.spec.ppo.minibatch_size, len(self.orders[0])))


def _seeds(
    student: ActorCritic,
    optimizer: RowAdam,
    samples: Samples,
    spec: UpdateSpec,
    rngs: Sequence[np.random.Generator],
) -> Iterator[_Seed]:
    assert student.normalizer is not None
    obs = student.normalizer.normalize(samples.observations.take(samples.rows)).numpy()
    for s, (n, rng) in enumerate(zip(samples.counts.tolist(), rngs, strict=True)):
        orders = np.stack([rng.permutation(n) for _ in range(spec.ppo.n_epochs)])
        yield _Seed(student, optimizer, spec, s, obs[s], orders)


def _policy_steps(seed: _Seed, data: PolicyData, metrics: np.ndarray) -> int:
    """Take all steps of a seed's policy; return how many."""
    student, optimizer, s = seed.student, seed.optimizer, seed.s
    if data.discrete:
        log_std = slope = np.zeros(0, np.float32)
    else:
        log_std, slope = leaf_view(student, s, "policy.log_std")
    network = network_view(student, s, "policy", seed.size)
    spec = seed.spec
    adam = adam_view(student, optimizer, s, "policy", spec.policy_scale, spec.ppo.max_grad_norm)
    steps = learn_policy(
        network, adam, log_std, slope, seed.obs, seed.orders, data, spec.target_kl, metrics
    )
    optimizer.steps[0, s] += steps
    return steps


def _value_steps(seed: _Seed, returns: np.ndarray, metrics: np.ndarray) -> int:
    """Take all steps of a seed's critic; return how many."""
    student, optimizer, s = seed.student, seed.optimizer, seed.s
    network = network_view(student, s, "value", seed.size)
    spec = seed.spec
    adam = adam_view(student, optimizer, s, "value", 1.0, spec.ppo.max_grad_norm)
    steps = learn_value(network, adam, seed.obs, seed.orders, returns, spec.ppo.vf_coef, metrics)
    optimizer.steps[1, s] += steps
    return steps


def _policy_data(student: ActorCritic, samples: Samples, spec: UpdateSpec) -> list[PolicyData]:
    """Return what each seed's policy learns from; actions are one-hot where discrete."""
    discrete, actions = student.spaces.discrete, samples.actions
    if discrete:
        actions = torch.nn.functional.one_hot(actions, student.spaces.n_actions).float()
    teacher = log_std = torch.zeros_like(actions)
    if isinstance(spec.teacher, Gaussian):
        teacher = spec.teacher.mean
        log_std = spec.teacher.log_std.expand_as(teacher).contiguous()
    elif isinstance(spec.teacher, Categorical):
        teacher = spec.teacher.log_probs
    betas = torch.as_tensor(0.0 if spec.teacher is None else spec.beta).expand(len(actions))
    ent_coef = spec.ppo.ent_coef if spec.loss == "representation" else 0.0
    log_probs, advantages = samples.behavior_log_probs.numpy(), samples.advantages.numpy()
    if spec.loss == "distillation":  # with Â = 0 only the cross-entropy is left
        advantages = np.zeros_like(advantages)
    return [
        PolicyData(
            discrete, actions[s].numpy(), log_probs[s], advantages[s], teacher[s].numpy(),
            log_std[s].numpy(), spec.clip_range, ent_coef, beta,
        )
        for s, beta in enumerate(betas.tolist())
    ]  # fmt: skip


def _means(metrics: np.ndarray, steps: np.ndarray) -> dict[str, np.ndarray]:
    """Return each seed's means over its steps, (S,) each, nan of none.

    Args:
        metrics: of each step, named by METRIC_NAMES, (S, steps, 7).
        steps: how many each seed took, by metric, (S, 7).

    Raises:
        DivergedError: a loss is not finite.
    """
    diverged = ~np.isfinite(metrics)
    diverged[..., 3:6] = False  # diagnostics, no parts of a loss
    if diverged.any():
        s, step, column = np.argwhere(diverged)[0]
        raise DivergedError.of_loss(METRIC_NAMES[column], metrics[s, step, column], int(s))
    with np.errstate(invalid="ignore", over="ignore"):
        means = (metrics.sum(1) / steps).astype(np.float32)  # (S, 7)
    return dict(zip(METRIC_NAMES, means.T, strict=True))


def _as_written(metrics: dict[str, np.ndarray], spec: UpdateSpec) -> dict[str, np.ndarray]:
    """Return the metrics that the update as written has, by their names there."""
    if spec.loss == "distillation":
        return {"cross_entropy": metrics["cross_entropy"]}
    if spec.loss == "instance":
        clipped = {"kept_clip_fraction": metrics["clip_fraction"]}
        return {name: metrics[name] for name in OF_INSTANCES} | clipped
    without = {"log_ratio"} if spec.teacher is not None else {"log_ratio", "cross_entropy"}
    return spec.of_moved({n: values for n, values in metrics.items() if n not in without})
