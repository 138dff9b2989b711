"""Schedules: functions of the iteration k, which counts from 1."""

from typing import Literal

from repaint_cli.settings import PPOConfig
from repaint_cli.tasks.transfer_settings import SelectConfig, TransferConfig

Phase = Literal["ppo", "critic", "representation", "instance", "joint"]
"""Plain PPO, the critic alone, kickstarting, instance transfer, or both of the last in one."""


def phase(k: int, transfer: TransferConfig) -> Phase:
    """Return what iteration k does: R representation, then I instance iterations, and again.

    1:1 is algorithm 2, whose odd iterations are representation transfer; after K iterations only
    PPO remains, against the bias that selection brings (paper, section 5.1). The first iterations
    may belong to the critic alone; the rounds begin after them.
    """
    if k <= transfer.critic_warmup:
        return "critic"
    if k > transfer.iterations:
        return "ppo"
    if transfer.instance and transfer.joint:
        return "joint"
    round_length = transfer.representation + transfer.instance
    if (k - 1 - transfer.critic_warmup) % round_length >= transfer.representation:
        return "instance"
    return "representation" if any(transfer.betas(1)) else "ppo"


def kickstart_coefs(k: int, transfer: TransferConfig, n_teachers: int = 1) -> tuple[float, ...]:
    """Return β_k of each teacher while the transfer lasts, then 0 (paper, appendices A and C.3).

        geometric  β₀·dⁿ            linear    β₀·(1 − n/K)
        constant   β₀               stepwise  β₀·d^⌊n/m⌋

    with d = `kickstart_decay`, m = `kickstart_every` and n the iterations before this one: all of
    them, as in the paper's β_{k+1} = 0.95·β_k, or only those of representation transfer.
    """
    if k > transfer.iterations:
        return (0.0,) * n_teachers
    n = k - 1
    if transfer.kickstart_counts == "representation":
        n = sum(phase(j, transfer) in ("representation", "joint") for j in range(1, k))
    share = {
        "geometric": transfer.kickstart_decay**n,
        "linear": 1 - n / transfer.iterations,
        "constant": 1.0,
        "stepwise": transfer.kickstart_decay ** (n // transfer.kickstart_every),
    }[transfer.kickstart_schedule]
    return tuple(share * beta for beta in transfer.betas(n_teachers))


def threshold(k: int, select: SelectConfig, transfer: TransferConfig) -> float:
    """Return ζ, which moves in a straight line from its first to its last value over K."""
    if select.last_threshold is None or transfer.iterations == 1:
        return select.threshold
    done = (k - 1) / (transfer.iterations - 1)
    return select.threshold + done * (select.last_threshold - select.threshold)


def power(k: int, transfer: TransferConfig) -> float:
    """Return k^−a while the transfer lasts, then 1."""
    return float(k) ** -transfer.alpha_power if k <= transfer.iterations else 1.0


def alphas(k: int, transfer: TransferConfig) -> tuple[float, float]:
    """Return α₁ and α₂, both times k^−a (paper, section 5.1, whose A_k is their quotient).

    After the transfer α₁ is 1: what remains is PPO.
    """
    if k > transfer.iterations:
        return 1.0, transfer.alpha_2
    return transfer.alpha_1 * power(k, transfer), transfer.alpha_2 * power(k, transfer)


def clip_range(k: int, ppo: PPOConfig) -> float:
    """Return ε, which falls in a straight line to 0 over `clip_decay` iterations, if given."""
    return ppo.clip_range * _left(k, ppo.clip_decay)


def learning_rate(k: int, ppo: PPOConfig) -> float:
    """Return Adam's step size, which falls likewise over `learning_rate_decay`, if given."""
    return ppo.learning_rate * _left(k, ppo.learning_rate_decay)


def _left(k: int, iterations: int | None) -> float:
    return 1.0 if iterations is None else max(0.0, 1 - (k - 1) / iterations)
