"""What iteration k does: functions of k, which counts from 1."""

from typing import Literal

from repaint_cli.config import TransferConfig

Phase = Literal["ppo", "representation", "instance", "joint"]
"""Plain PPO, kickstarting, instance transfer, or both of the last in one update."""


def kickstart_coef(k: int, transfer: TransferConfig) -> float:
    """Return β_k = β₀·0.95^(k−1) while the transfer lasts, then 0 (paper, appendix B.2)."""
    if k > transfer.iterations:
        return 0.0
    return transfer.kickstart_coef * transfer.kickstart_decay ** (k - 1)


def phase(k: int, transfer: TransferConfig) -> Phase:
    """Return what iteration k does: R representation, then I instance iterations, and again.

    1:1 is algorithm 2, whose odd iterations are representation transfer; after K iterations only
    PPO remains, against the bias that selection brings (paper, section 5.1).
    """
    if k > transfer.iterations:
        return "ppo"
    if transfer.instance and transfer.joint:
        return "joint"
    round_length = transfer.representation + transfer.instance
    if (k - 1) % round_length >= transfer.representation:
        return "instance"
    return "representation" if transfer.kickstart_coef > 0 else "ppo"
