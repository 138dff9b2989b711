"""Gradient steps: epochs of minibatches, for all seeds at once and for each as if alone."""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from repaint_cli.errors import DivergedError
from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.learn.update.adam import RowAdam
from repaint_cli.learn.update.compiled import update as compiled
from repaint_cli.learn.update.compiled.update import Parts, told_by
from repaint_cli.learn.update.objectives import instance_loss, representation_loss
from repaint_cli.policies.distributions import Distribution
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.settings import PPOConfig


class Means:
    """Each seed's mean of named numbers over the gradient steps it took part in."""

    def __init__(self) -> None:
        self._steps: dict[str, list[tuple[Tensor, Tensor]]] = {}

    def add(self, counts: Tensor, numbers: dict[str, Tensor]) -> None:
        """Take numbers (S,) of the seeds whose count of samples is above 0."""
        for name, number in numbers.items():
            self._steps.setdefault(name, []).append((counts, number.detach()))

    def numpy(self) -> dict[str, np.ndarray]:
        """Return the means, (S,) each; nan for a seed that took no step."""
        means = {}
        for name, steps in self._steps.items():
            counts, numbers = map(torch.stack, zip(*steps, strict=True))  # (steps, S)
            took_part = counts > 0
            means[name] = (numbers.where(took_part, 0.0).sum(0) / took_part.sum(0)).numpy()
        return means


def shuffle(samples: Samples, rngs: Sequence[np.random.Generator]) -> Tensor:
    """Return an order of each seed's samples, (S, B), by its own generator; padding is last."""
    orders = [
        torch.from_numpy(rng.permutation(n))
        for rng, n in zip(rngs, samples.counts.tolist(), strict=True)
    ]
    return torch.nn.utils.rnn.pad_sequence(orders, batch_first=True)


def part(order: Tensor, starts: Tensor, stops: Tensor) -> tuple[Tensor, Tensor]:
    """Return positions order[s, starts[s]:stops[s]], padded to (S, b), and their counts."""
    counts = stops - starts
    reach = starts.unsqueeze(1) + torch.arange(int(counts.max()))
    return order.gather(1, reach.clamp(max=order.shape[1] - 1)), counts


def learn_on_policy(
    student: ActorCritic,
    optimizer: RowAdam,
    samples: Samples,
    ppo: PPOConfig,
    rngs: Sequence[np.random.Generator],
    *,
    teacher: Distribution | None = None,
    beta: Tensor | float = 0.0,
    rate: float = 1.0,
    instances: Samples | None = None,
    alphas: tuple[float, float] = (1.0, 1.0),
    parts: Parts = "both",
) -> dict[str, np.ndarray]:
    """Train on the student's own samples: PPO, kickstarting, or both transfers jointly.

    Args:
        student: who learns.
        optimizer: its optimiser.
        samples: the student's, Â standardised.
        ppo: epochs, minibatches and coefficients.
        rngs: one generator per seed for the order of the samples.
        teacher: the teacher's distributions at the samples, for the cross-entropy.
        beta: β_k, of all seeds or (S,).
        rate: scales the policies' learning rate.
        instances: selected teacher samples; every minibatch takes its share of them (paper,
            algorithm 1).
        alphas: α₁ and α₂, which in a joint update scale L_rep and L_ins.
        parts: who moves, policies, critics or both.

    Returns:
        Each seed's mean losses and diagnostics, (S,) each.

    Raises:
        DivergedError: a loss is not finite.
    """
    if compiled.applies_to(student, ppo) and instances is None:
        return compiled.learn(
            student, optimizer, samples, ppo, rngs,
            teacher=teacher, beta=beta, scale=rate, parts=parts,
        )  # fmt: skip
    if parts == "policy":  # for what both share
        ppo = ppo.model_copy(update={"vf_coef": 0.0})
    means, size = Means(), ppo.minibatch_size
    n_steps = -(-samples.counts // size)  # each seed's own ceil(n / 64)
    for _ in range(ppo.n_epochs):
        order = shuffle(samples, rngs)
        extra = None if instances is None else shuffle(instances, rngs)
        for j in range(int(n_steps.max())):
            bounds = (samples.counts.clamp(max=size * j), samples.counts.clamp(max=size * (j + 1)))
            positions, counts = part(order, *bounds)
            batch = samples.pick(positions, counts)
            target = None if teacher is None else teacher[_seats(positions)]
            loss, numbers = representation_loss(student, batch, target, beta, ppo)
            if instances is not None and extra is not None:
                done = torch.tensor([[j], [j + 1]]).minimum(n_steps) * instances.counts // n_steps
                share = instances.pick(*part(extra, done[0], done[1]))
                ins_loss, seen = instance_loss(student, share, ppo)
                loss = alphas[0] * loss + alphas[1] * ins_loss
                told = ("log_ratio", "kept_clip_fraction")
                means.add(share.counts, {name: seen[name] for name in told})
            means.add(counts, numbers)
            moving = (counts > 0).tolist()
            still = [False] * student.n_seeds
            _check_finite(loss, numbers)
            _step(
                student, optimizer, loss,
                still if parts == "critic" else moving, still if parts == "policy" else moving,
                rate,
            )  # fmt: skip
    return told_by(parts, means.numpy())


def learn_from_instances(
    student: ActorCritic,
    optimizer: RowAdam,
    samples: Samples,
    ppo: PPOConfig,
    rngs: Sequence[np.random.Generator],
    alpha_2: float = 1.0,
) -> dict[str, np.ndarray]:
    """Train the policy, and only it, on selected teacher samples (algorithm 2, even k).

    A seed that kept no samples takes no step. See `learn_on_policy` for the arguments.
    """
    if compiled.applies_to(student, ppo):
        return compiled.learn(student, optimizer, samples, ppo, rngs, scale=alpha_2, instances=True)
    means, size = Means(), ppo.minibatch_size
    still = [False] * student.n_seeds
    for _ in range(ppo.n_epochs):
        order = shuffle(samples, rngs)
        for start in range(0, order.shape[1], size):
            bounds = (samples.counts.clamp(max=start), samples.counts.clamp(max=start + size))
            positions, counts = part(order, *bounds)
            loss, numbers = instance_loss(student, samples.pick(positions, counts), ppo)
            means.add(counts, numbers)
            _check_finite(loss, numbers)
            _step(student, optimizer, loss, (counts > 0).tolist(), still, alpha_2)
    return means.numpy()


def _seats(positions: Tensor) -> tuple[Tensor, Tensor]:
    return torch.arange(len(positions)).unsqueeze(1), positions


def _check_finite(loss: Tensor, parts: dict[str, Tensor]) -> None:
    """Check each seed's loss (S,); name the first of its parts that is not finite."""
    if torch.isfinite(loss).all():
        return
    row = int((~torch.isfinite(loss)).nonzero()[0])
    name = next((n for n, part in parts.items() if not torch.isfinite(part[row])), "loss")
    raise DivergedError.of_loss(name, parts.get(name, loss)[row].item(), row)


def _step(
    student: ActorCritic,
    optimizer: RowAdam,
    loss: Tensor,
    policies: list[bool],
    critics: list[bool],
    scale: float,
) -> None:
    """Follow the gradient of the sum of all seeds' losses, (S,); seeds share no parameter."""
    student.gradients.zero_()
    torch.autograd.backward(loss.sum())
    optimizer.step(policies, critics, scale)
