"""Distillation: students imitate their teachers' advice on their own samples, and nothing else."""

from dataclasses import replace

import numpy as np

from repaint_cli.learn.learner import Learner
from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.learn.rollout.observations import Observations
from repaint_cli.learn.transfer.iteration import Iteration
from repaint_cli.learn.update.spec import UpdateSpec
from repaint_cli.learn.update.update import update
from repaint_cli.policies.compound import Compound
from repaint_cli.policies.distributions import Distribution
from repaint_cli.symmetry import Symmetry
from repaint_cli.tasks.card import TaskCard


def distil(
    card: TaskCard, learner: Learner, now: Iteration, samples: Samples, advice: Distribution
) -> dict[str, np.ndarray]:
    """Follow H(T‖π) alone for `transfer.distill_epochs`, on the students' own samples.

    A seed whose β_k are all 0 is left alone; for the others their size does not matter. With
    `transfer.distill_mirrored` the samples' mirror images count as well, with the advice at the
    samples mirrored.

    Args:
        card: the target task.
        learner: whose policies move, with their step size times α₁.
        now: the iteration.
        samples: the students' own, (S, B).
        advice: T, the blend of the teachers by their β_k, at the samples, (S, B).

    Returns:
        The mean cross-entropy on the way, (S,); nan of a seed that was left alone.
    """
    transfer = card.transfer
    batch = replace(samples, counts=samples.counts * now.betas.any(0), behavior=advice)
    if transfer.distill_mirrored:
        batch = Samples.concatenate([batch, _mirrored(batch, card.symmetries[0])])
    changed = {"n_epochs": transfer.distill_epochs, "minibatch_size": transfer.distill_minibatch}
    spec = UpdateSpec(
        card.ppo.model_copy(update=changed), now.clip_range, loss="distillation",
        networks="policy", teacher=batch.behavior, beta=1.0, policy_scale=now.policy_scale,
    )  # fmt: skip
    rngs = [rng.spawn(1)[0] for rng in learner.shuffles(now.k)]
    metrics = update(learner.student, learner.optimizer, batch, spec, rngs)
    return {"distill_cross_entropy": metrics["cross_entropy"]}


def _mirrored(samples: Samples, symmetry: Symmetry) -> Samples:
    """Return samples as they are in a mirror: observations, actions, and the advice at them."""
    assert not isinstance(samples.behavior, Compound | None)  # whose tasks have no symmetry
    stores = [symmetry.observe(store) for store in samples.observations.stores]
    return replace(
        samples,
        observations=Observations(stores),
        actions=symmetry.act(samples.actions),
        behavior=samples.behavior.mirrored(symmetry.actions),
    )
