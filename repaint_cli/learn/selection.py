"""Which teacher samples survive: advantage-based experience selection (paper, section 4.2)."""

from dataclasses import replace

from torch import Tensor

from repaint_cli.learn.advantages import Samples

Moments = tuple[Tensor, Tensor]
"""Mean and standard deviation of a batch of advantages, (S, 1) each."""


def moments(samples: Samples) -> Moments:
    """Return each seed's mean and standard deviation of Â over its real samples, (S, 1) each."""
    mask, n = samples.mask, samples.counts.unsqueeze(1)
    mean = (samples.advantages * mask).sum(1, keepdim=True) / n
    var = ((samples.advantages - mean) ** 2 * mask).sum(1, keepdim=True) / n
    return mean, var.sqrt()


def standardize(samples: Samples, by: Moments) -> Samples:
    """Return the samples with (Â − mean) / (std + 10⁻⁸) in place of Â."""
    mean, std = by
    return replace(samples, advantages=(samples.advantages - mean) / (std + 1e-8))


def rescale(samples: Samples, scale: str, student: Moments) -> Samples:
    """Return teacher samples with Â′ on the scale that ζ is meant on.

    Args:
        samples: of the teacher, Â′ raw: under the target's reward with the student's critic.
        scale: "teacher-batch" standardises Â′ within the batch, so a fixed share of any teacher
            passes; "student-batch" with the moments of the student's own last batch, so that a
            teacher is judged against the student and the critic's bias cancels; "none" leaves Â′
            raw, as the paper's text reads.
        student: moments of the student's last on-policy batch.
    """
    if scale == "none":
        return samples
    return standardize(samples, moments(samples) if scale == "teacher-batch" else student)


def above_threshold(advantages: Tensor, threshold: float) -> Tensor:
    """Return where Â′ ≥ ζ, (S, B) bool: algorithms 1 and 2 remove the transitions with Â′ < ζ."""
    return advantages >= threshold
