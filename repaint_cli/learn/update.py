"""Gradient steps: epochs of minibatches, for all seeds at once and for each as if alone."""

from collections.abc import Callable, Sequence

import numpy as np
import torch
from torch import Tensor

from repaint_cli.config import PPOConfig
from repaint_cli.distributions import Distribution
from repaint_cli.errors import DivergedError
from repaint_cli.learn import by_hand
from repaint_cli.learn.advantages import Samples
from repaint_cli.learn.losses import approx_kl, clipped_surrogate, squared_error
from repaint_cli.learn.optimizer import RowAdam
from repaint_cli.nets import ActorCritic


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


def mean_over(counts: Tensor, width: int) -> Callable[[Tensor], Tensor]:
    """Return what takes each seed's mean of its first counts[s] numbers, (S, width) → (S,).

    The mean of none is 0.
    """
    mask = torch.arange(width) < counts.unsqueeze(1)
    weights = mask / counts.clamp(min=1).unsqueeze(1)
    return lambda numbers: (numbers * weights).sum(-1)


def masked_mean(numbers: Tensor, counts: Tensor) -> Tensor:
    """Return each seed's mean of its first counts[s] numbers, (S, b) → (S,); 0 of none."""
    return mean_over(counts, numbers.shape[1])(numbers)


def representation_loss(
    student: ActorCritic, batch: Samples, teacher: Distribution | None, beta: float, ppo: PPOConfig
) -> tuple[Tensor, dict[str, Tensor]]:
    """Return −L_rep with the critic's loss and PPO's entropy bonus, (S,), and their parts.

        L_rep(θ) = L_clip(θ) − β_k·H(π_teacher‖π_θ)      (paper, equation 2)

    Without a teacher it is clipped PPO.
    """
    obs, counts = batch.frames.take(batch.rows), batch.counts
    policy = student.policy(obs, counts.tolist())
    values = student.value(obs, counts.tolist())
    log_probs, mean = policy.log_prob(batch.actions), mean_over(counts, batch.rows.shape[1])
    surrogate = clipped_surrogate(
        log_probs, batch.behavior_log_probs, batch.advantages, ppo.clip_range
    )
    numbers = {
        "policy_loss": mean(surrogate),
        "value_loss": mean(squared_error(values, batch.returns)),
        "entropy": mean(policy.entropy().expand_as(log_probs)),
    } | _ratio_numbers(log_probs, batch, ppo.clip_range, mean)
    loss = (
        numbers["policy_loss"]
        + ppo.vf_coef * numbers["value_loss"]
        - ppo.ent_coef * numbers["entropy"]
    )
    if teacher is not None:
        numbers["cross_entropy"] = mean(teacher.cross_entropy(policy))
        loss = loss + beta * numbers["cross_entropy"]
    return loss, numbers


def instance_loss(
    student: ActorCritic, batch: Samples, ppo: PPOConfig
) -> tuple[Tensor, dict[str, Tensor]]:
    """Return −L_ins, (S,): the clipped surrogate on teacher samples (paper, equation 3).

    No cross-entropy, no entropy bonus, and no critic: its values are regressed on the student's own
    data only.
    """
    policy = student.policy(batch.frames.take(batch.rows), batch.counts.tolist())
    log_probs, mean = policy.log_prob(batch.actions), mean_over(batch.counts, batch.rows.shape[1])
    surrogate = clipped_surrogate(
        log_probs, batch.behavior_log_probs, batch.advantages, ppo.clip_range
    )
    loss = mean(surrogate)
    numbers = {"policy_loss": loss} | _ratio_numbers(log_probs, batch, ppo.clip_range, mean)
    log_ratio = mean(log_probs - batch.behavior_log_probs)
    return loss, numbers | {"log_ratio": log_ratio, "kept_clip_fraction": numbers["clip_fraction"]}


def _ratio_numbers(
    log_probs: Tensor, batch: Samples, clip_range: float, mean: Callable[[Tensor], Tensor]
) -> dict[str, Tensor]:
    with torch.no_grad():
        log_ratio = log_probs - batch.behavior_log_probs
        return {
            "approx_kl": mean(approx_kl(log_probs, batch.behavior_log_probs)),
            "clip_fraction": mean((torch.expm1(log_ratio).abs() > clip_range).float()),
        }


def learn_on_policy(
    student: ActorCritic,
    optimizer: RowAdam,
    samples: Samples,
    ppo: PPOConfig,
    rngs: Sequence[np.random.Generator],
    *,
    teacher: Distribution | None = None,
    beta: float = 0.0,
    alpha_1: float = 1.0,
    instances: Samples | None = None,
    alpha_2: float = 1.0,
) -> dict[str, np.ndarray]:
    """Train on the student's own samples: PPO, kickstarting, or both transfers jointly.

    Args:
        student: who learns.
        optimizer: its optimiser.
        samples: the student's, Â standardised.
        ppo: epochs, minibatches and coefficients.
        rngs: one generator per seed for the order of the samples.
        teacher: the teacher's distributions at the samples, for the cross-entropy.
        beta: β_k.
        alpha_1: α₁; scales the learning rate, or in a joint update L_rep.
        instances: selected teacher samples; every minibatch takes its share of them (paper,
            algorithm 1).
        alpha_2: α₂, scales L_ins in a joint update.

    Returns:
        Each seed's mean losses and diagnostics, (S,) each.

    Raises:
        DivergedError: a loss is not finite.
    """
    if ppo.compiled and by_hand.applies_to(student) and instances is None:
        return by_hand.learn(
            student, optimizer, samples, ppo, rngs, teacher=teacher, beta=beta, scale=alpha_1
        )
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
                loss = alpha_1 * loss + alpha_2 * ins_loss
                told = ("log_ratio", "kept_clip_fraction")
                means.add(share.counts, {name: seen[name] for name in told})
            means.add(counts, numbers)
            moving = (counts > 0).tolist()
            scale = 1.0 if instances is not None else alpha_1
            _check_finite(loss, numbers)
            _step(student, optimizer, loss, moving, moving, scale)
    return means.numpy()


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
    if ppo.compiled and by_hand.applies_to(student):
        return by_hand.learn(student, optimizer, samples, ppo, rngs, scale=alpha_2, critic=False)
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
