"""The update as written: epochs of minibatches, for all seeds at once, each as if alone."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from math import isfinite
from operator import or_

import numpy as np
import torch
from torch import Tensor

from repaint_cli.activity import advance, progress
from repaint_cli.errors import DivergedError
from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.learn.side_by_side import check, side_by_side
from repaint_cli.learn.update.adam import RowAdam
from repaint_cli.learn.update.means import Means
from repaint_cli.learn.update.objectives import (
    distillation_loss,
    instance_loss,
    representation_loss,
)
from repaint_cli.learn.update.spec import Networks, UpdateSpec
from repaint_cli.policies.distributions import Distribution
from repaint_cli.policies.networks import ActorCritic


def shuffle(samples: Samples, rngs: Sequence[np.random.Generator]) -> Tensor:
    """Return an order of each seed's samples, (S, B), by its own generator; padding is last."""
    orders = [
        torch.from_numpy(rng.permutation(n))
        for rng, n in zip(rngs, samples.counts.tolist(), strict=True)
    ]
    return torch.nn.utils.rnn.pad_sequence(orders, batch_first=True)


def minibatch(order: Tensor, starts: Tensor, stops: Tensor) -> tuple[Tensor, Tensor]:
    """Return positions order[s, starts[s]:stops[s]], padded to (S, b), and their counts."""
    counts = stops - starts
    reach = starts.unsqueeze(1) + torch.arange(int(counts.max()))
    return order.gather(1, reach.clamp(max=order.shape[1] - 1)), counts


@dataclass(frozen=True)
class _Orders:
    """The order of samples in each epoch, (epochs,) of (S, B), and of teacher samples (S, K)."""

    own: list[Tensor]
    of_instances: list[Tensor]

    @classmethod
    def draw(
        cls, samples: Samples, spec: UpdateSpec, rngs: Sequence[np.random.Generator]
    ) -> "_Orders":
        """Draw them by each seed's own generator, those of instances by one that it spawns."""
        of_instances = []
        if spec.instances is not None:  # by generators of their own, which leave the others alone
            others = [rng.spawn(1)[0] for rng in rngs]
            of_instances = [shuffle(spec.instances, others) for _ in range(spec.ppo.n_epochs)]
        return cls([shuffle(samples, rngs) for _ in range(spec.ppo.n_epochs)], of_instances)


def take_steps(
    student: ActorCritic,
    optimizer: RowAdam,
    samples: Samples,
    spec: UpdateSpec,
    rngs: Sequence[np.random.Generator],
) -> dict[str, np.ndarray]:
    """Take the gradient steps with autograd; see `update.update`.

    Seed by seed, as if each were alone, and where they read images and share no layers its policy
    and its critic side by side; dense networks all at once where `ppo.stacked`.
    """
    batches, image = -(-samples.counts // spec.ppo.minibatch_size), student.spaces.image
    if spec.ppo.stacked and not image:
        progress(0, spec.ppo.n_epochs * int(batches.max()), "batches")
        return _take_steps(student, optimizer, samples, spec, _Orders.draw(samples, spec, rngs))
    apart = image and spec.networks == "both" and not student.net.shared
    parts: list[Networks] = ["policy", "critic"] if apart else [spec.networks]
    progress(0, spec.ppo.n_epochs * len(parts) * int(batches.sum()), "batches")
    alone = [
        (student.alone(s), optimizer.alone(s), samples.alone(s)) for s in range(student.n_seeds)
    ]
    specs = [spec.alone(s, n) for s, n in enumerate(samples.counts.tolist())]
    orders = [_Orders.draw(own[2], specs[s], [rngs[s]]) for s, own in enumerate(alone)]

    def steps(networks: Networks, s: int) -> dict[str, np.ndarray]:
        return _take_steps(*alone[s], replace(specs[s], networks=networks), orders[s])

    return seed_by_seed([partial(steps, n) for n in parts], student.n_seeds, image)


def seed_by_seed(
    jobs: Sequence[Callable[[int], dict[str, np.ndarray]]], n_seeds: int, together: bool
) -> dict[str, np.ndarray]:
    """Do each job for each seed by itself; return their metrics, (S,) each, nan of no step.

    Args:
        jobs: map a seed's number to its metrics, (1,) each.
        n_seeds: S.
        together: whether they go side by side; jobs of many small steps would wait for each other.

    Raises:
        DivergedError: a seed's loss is not finite; others have taken some of their steps.
    """

    def alone(job: Callable[[int], dict[str, np.ndarray]], s: int) -> dict[str, np.ndarray]:
        try:
            return job(s)
        except DivergedError as error:
            error.row = s  # it was the only one
            raise

    calls = [partial(alone, job, s) for s in range(n_seeds) for job in jobs]
    results = side_by_side(calls) if together else [call() for call in calls]
    parts = [reduce(or_, results[i : i + len(jobs)]) for i in range(0, len(calls), len(jobs))]
    names = dict.fromkeys(name for part in parts for name in part)
    nothing = np.full(1, np.nan, np.float32)
    return {name: np.concatenate([part.get(name, nothing) for part in parts]) for name in names}


def _take_steps(
    student: ActorCritic, optimizer: RowAdam, samples: Samples, spec: UpdateSpec, orders: _Orders
) -> dict[str, np.ndarray]:
    """Take the steps of all seeds together, in minibatches (S, b) of each seed's own samples."""
    means, size = Means(), spec.ppo.minibatch_size
    n_steps = -(-samples.counts // size)  # each seed's own ceil(n / 64)
    active = torch.ones(len(n_steps), dtype=torch.bool)  # whose policies move, (S,)
    for epoch, order in enumerate(orders.own):
        of_epoch = Means()
        for j in range(int(n_steps.max())):
            bounds = (samples.counts.clamp(max=size * j), samples.counts.clamp(max=size * (j + 1)))
            positions, counts = minibatch(order, *bounds)
            instances = None
            if spec.instances is not None and spec.moves_policy and active.any():
                steps = torch.tensor([[j], [j + 1]])
                instances = _share(orders.of_instances[epoch], spec, steps, n_steps)
                _keep_instance_gradient(student, optimizer, instances, spec, means, active)
            batch, teacher = at(samples, spec, positions, counts)
            loss, metrics = loss_of(student, batch, teacher, spec)
            means.add(counts, metrics, active)
            means.watch(loss, metrics)
            of_epoch.add(counts, metrics, active)
            follow(student, optimizer, loss, counts > 0, active, spec)
            if instances is not None:
                moving, norm = (instances.counts > 0) & active, spec.ppo.max_grad_norm
                optimizer.step_on_instances(moving.tolist(), spec.instance_scale, norm)
            advance()
            check()
        means.check_finite()
        if isfinite(spec.target_kl) and spec.moves_policy:
            active &= ~(torch.from_numpy(of_epoch.numpy()["approx_kl"]) > spec.target_kl)
            if not (active.any() or spec.moves_critic):
                break
    return spec.of_moved(means.numpy())


def at(
    samples: Samples, spec: UpdateSpec, positions: Tensor, counts: Tensor
) -> tuple[Samples, Distribution | None]:
    """Return the samples at positions (S, b), and what the teacher advises there."""
    if spec.teacher is None:
        return samples.pick(positions, counts), None
    positions = positions.to(samples.rows.device)
    seeds = torch.arange(len(positions), device=positions.device).unsqueeze(1)
    return samples.pick(positions, counts), spec.teacher[seeds, positions]


def loss_of(
    student: ActorCritic, batch: Samples, teacher: Distribution | None, spec: UpdateSpec
) -> tuple[Tensor, dict[str, Tensor]]:
    """Return the loss (S,) of a minibatch (S, b), with the teacher's advice, and its metrics."""
    if spec.loss == "instance":
        return instance_loss(student, batch, spec)
    if spec.loss == "distillation":
        assert teacher is not None
        return distillation_loss(student, batch, teacher)
    return representation_loss(student, batch, teacher, spec)


def _share(order: Tensor, spec: UpdateSpec, steps: Tensor, n_steps: Tensor) -> Samples:
    """Return the instances of one of a seed's n_steps (S,) minibatches, spread evenly over them.

    Args:
        order: of the instances, (S, K).
        spec: which instances.
        steps: the minibatch's number, and the next one's, (2, 1).
        n_steps: how many minibatches each seed has, (S,).
    """
    assert spec.instances is not None
    bounds = steps.minimum(n_steps) * spec.instances.counts // n_steps
    return spec.instances.pick(*minibatch(order, bounds[0], bounds[1]))


def _keep_instance_gradient(
    student: ActorCritic, optimizer: RowAdam, instances: Samples, spec: UpdateSpec, means: Means,
    active: Tensor,
) -> None:  # fmt: skip
    """Keep ∇L_ins at θ until ∇L_rep at the same θ is known, and add the metrics of L_ins.

    θ ← θ + α₁·Adam(∇L_rep) + α₂·Adam(∇L_ins)      (paper, algorithm 1)

    `active` says whose policies still move, (S,).
    """
    assert optimizer.of_instances is not None
    loss, metrics = instance_loss(student, instances, spec)
    kept = {name: metrics[name] for name in ("log_ratio", "kept_clip_fraction")}
    means.add(instances.counts, kept, active)
    means.watch(loss, metrics)
    differentiate(student, loss, "policy")
    optimizer.of_instances.gradients.copy_(student.gradients[:, : student.n_policy])


def differentiate(student: ActorCritic, loss: Tensor, networks: Networks) -> None:
    """Put the gradient of all seeds' losses, (S,), in place; seeds share no parameter."""
    columns = _columns(student, networks)
    student.gradients[:, columns].zero_()  # the others may be learning meanwhile
    torch.autograd.backward(loss.sum())


def _columns(student: ActorCritic, networks: Networks) -> slice:
    """Return where the parameters of these networks are in a seed's row."""
    cut = student.n_policy
    return {"both": slice(None), "policy": slice(cut), "critic": slice(cut, None)}[networks]


def follow(
    student: ActorCritic,
    optimizer: RowAdam,
    loss: Tensor,
    moving: Tensor,
    active: Tensor,
    spec: UpdateSpec,
) -> None:
    """Follow the gradient of all seeds' losses, (S,), and of the squared norm of their weights.

    `moving` says who has samples, (S,), and `active` whose policies have not stopped, (S,).
    """
    differentiate(student, loss, spec.networks)
    if decay := spec.ppo.weight_decay:
        columns = _columns(student, spec.networks)
        weights = student.storage[:, columns] * student.is_weight[columns]
        student.gradients[:, columns] += decay * weights
    frozen = [False] * student.n_seeds
    policies = (moving & active).tolist() if spec.moves_policy else frozen
    critics = moving.tolist() if spec.moves_critic else frozen
    optimizer.step(policies, critics, spec.policy_scale, spec.ppo.max_grad_norm)
