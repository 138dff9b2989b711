"""Which teacher samples survive: experience selection (paper, sections 4.2 and 6.2).

The paper's rule keeps Â′ ≥ ζ; the others are those it was compared with.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from repaint_cli.learn.rollout.batches import front, row_sums
from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.tasks.transfer_settings import SelectConfig

Moments = tuple[Tensor, Tensor]
"""Mean and standard deviation of a batch of advantages, (S, 1) each."""

PRIORITY_FLOOR = 1e-6
"""What prioritised replay adds to |Â′|, so that every sample may be drawn."""


def moments(samples: Samples) -> Moments:
    """Return each seed's mean and standard deviation of Â over its real samples, (S, 1) each."""
    n = samples.counts.clamp(min=1)
    mean = (row_sums(samples.advantages, samples.counts) / n).unsqueeze(1)
    var = (row_sums((samples.advantages - mean) ** 2, samples.counts) / n).unsqueeze(1)
    return mean, var.sqrt()


def standardize(samples: Samples, by: Moments) -> Samples:
    """Return the samples with (Â − mean) / (std + 10⁻⁸) in place of Â."""
    mean, std = by
    return replace(samples, advantages=(samples.advantages - mean) / (std + 1e-8))


def rescale(samples: Samples, scale: str, student: Moments) -> Samples:
    """Return teacher samples with Â′ on the scale that ζ is meant on.

    Args:
        samples: of the teachers, Â′ raw: under the target's reward with the student's critic.
        scale: "teacher-batch" standardises Â′ within the batch, so a fixed share of any teacher
            passes; "student-batch" with the moments of the student's own last batch, so that a
            teacher is judged against the student and the critic's bias cancels; "none" leaves Â′
            raw, as the paper's text reads.
        student: moments of the student's last on-policy batch.
    """
    if scale == "none":
        return samples
    return standardize(samples, moments(samples) if scale == "teacher-batch" else student)


def on_loss_scale(raw: Samples, selected: Samples, scale: str, student: Moments) -> Samples:
    """Return teacher samples with Â′ on the scale that L_ins learns from.

    Args:
        raw: of the teachers, Â′ under the target's reward with the student's critic.
        selected: the same, Â′ on the scale that ζ is meant on.
        scale: "selected", "raw", or "student": Â′/(σ + 10⁻⁸) with σ of the student's last batch, by
            which the Â of L_clip are divided too; the mean is not subtracted, so that the sign
            still says whether a sample is better than the student expects.
        student: moments of the student's last on-policy batch.
    """
    if scale == "student":
        return replace(raw, advantages=raw.advantages / (student[1] + 1e-8))
    return raw if scale == "raw" else selected


@dataclass(frozen=True)
class Selection:
    """Which samples to learn from, each seed with its own number."""

    positions: Tensor
    """Their positions among all samples, (S, K) int64."""
    counts: Tensor
    """How many of them are real, (S,) int64."""
    weights: Tensor | None = None
    """How much each counts, (S, K); equally where absent."""

    def at_least(self, n: int) -> "Selection":
        """Return it without the samples of seeds that have fewer than n."""
        return replace(self, counts=self.counts.where(self.counts >= n, 0))

    def of(self, samples: Samples) -> Samples:
        """Return the chosen samples; a weight w ≥ 0 makes Â′ to w·Â′, and so L_ins to w·L_ins.

        TRPO's penalty is not weighed: prioritised replay has none.
        """
        picked = samples.pick(self.positions, self.counts)
        if self.weights is None:
            return picked
        return replace(picked, advantages=self.weights * picked.advantages)


def select(
    samples: Samples,
    config: SelectConfig,
    threshold: float,
    rngs: Sequence[np.random.Generator],
    relevance: Tensor | None = None,
) -> Selection:
    """Choose among the teachers' samples by the rule `config.rule`.

    Args:
        samples: of the teachers, Â′ on the scale that the rule is meant on.
        config: the rule and its parameters.
        threshold: ζ of this iteration.
        rngs: one generator per seed, for the rules that draw.
        relevance: of each sample, (S, B), for the rule `rbt`.
    """
    if config.rule == "per":
        return prioritized(samples, config, rngs)
    if config.rule == "rbt":
        assert relevance is not None
        return Selection(*drawn(relevance, share_counts(samples.counts, config.share), rngs))
    mask = KEEPING_RULES[config.rule](samples, config, threshold) & samples.mask
    return Selection(*front(mask))


def above_threshold(advantages: Tensor, threshold: float) -> Tensor:
    """Return where Â′ ≥ ζ, (S, B) bool: algorithms 1 and 2 remove the transitions with Â′ < ζ."""
    return advantages >= threshold


def top_share(samples: Samples, share: Tensor | float) -> Tensor:
    """Return where Â′ is among the highest ⌈q·n⌉ of a seed's n, (S, B) bool; q may be (S,)."""
    order = samples.advantages.masked_fill(~samples.mask, -torch.inf).argsort(1, descending=True)
    first = torch.arange(order.shape[1]) < share_counts(samples.counts, share).unsqueeze(1)
    return torch.zeros_like(first).scatter(1, order, first)


def share_counts(counts: Tensor, share: Tensor | float) -> Tensor:
    """Return how many of n samples the share q is, ⌈q·n⌉, (S,)."""
    return torch.ceil(share * counts.double() - 1e-9).long()


def prioritized(
    samples: Samples, config: SelectConfig, rngs: Sequence[np.random.Generator]
) -> Selection:
    """Draw by priority, with advantages in place of TD errors (Schaul et al. 2016, eqs. 1 and 3.4).

        P(j) = p_j^α / Σ_l p_l^α,   p_j = |Â′_j| + 10⁻⁶
        w_j = (n·P(j))^−β / max_l (n·P(l))^−β

    The importance weights w make up for drawing more often what matters more.
    """
    priorities = (samples.advantages.abs().double() + PRIORITY_FLOOR) ** config.priority_exponent
    priorities = priorities * samples.mask
    chances = priorities / row_sums(priorities, samples.counts).unsqueeze(1)
    importance = (samples.counts.unsqueeze(1) * chances) ** -config.importance_exponent
    importance = importance.where(samples.mask, 0.0)
    weights = (importance / importance.amax(1, keepdim=True)).float()
    positions, counts = drawn(chances, share_counts(samples.counts, config.share), rngs)
    return Selection(positions, counts, weights.gather(1, positions))


def drawn(
    chances: Tensor, counts: Tensor, rngs: Sequence[np.random.Generator]
) -> tuple[Tensor, Tensor]:
    """Draw counts[s] positions with replacement, a stratum each, by chances (S, B).

    Returns:
        Positions, (S, K), and their counts, as given.
    """
    cumulative = chances.double().cumsum(1)
    longest = int(counts.max())
    rows = []
    for sums, n, rng in zip(cumulative, counts.tolist(), rngs, strict=True):
        points = torch.from_numpy((np.arange(n) + rng.random(n)) / max(n, 1)) * sums[-1]
        rows.append(torch.searchsorted(sums, points.clamp(max=sums[-1] * (1 - 1e-12)), right=True))
    padded = [torch.nn.functional.pad(row, (0, longest - len(row))) for row in rows]
    return torch.stack(padded), counts


KeepingRule = Callable[[Samples, SelectConfig, float], Tensor]
"""Returns which samples are kept, (S, B) bool, given the rule's parameters and ζ."""

KEEPING_RULES: dict[str, KeepingRule] = {
    "zeta": lambda samples, _, zeta: above_threshold(samples.advantages, zeta),
    "abs": lambda samples, _, zeta: above_threshold(samples.advantages.abs(), zeta),
    "top": lambda samples, config, _: top_share(samples, config.share),
    "all": lambda samples, *_: samples.mask,
}
"""Rules that keep or drop each sample, by their names in [select]."""
