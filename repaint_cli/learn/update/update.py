"""The one place that chooses how an update is computed: compiled, by graphs, or as written."""

from collections.abc import Sequence

import numpy as np

from repaint_cli.activity import doing
from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.learn.side_by_side import one_thread
from repaint_cli.learn.update import epochs, graphs
from repaint_cli.learn.update.adam import RowAdam
from repaint_cli.learn.update.compiled import update as compiled
from repaint_cli.learn.update.spec import UpdateSpec
from repaint_cli.policies.devices import HOST
from repaint_cli.policies.networks import ActorCritic


def update(
    student: ActorCritic,
    optimizer: RowAdam,
    samples: Samples,
    spec: UpdateSpec,
    rngs: Sequence[np.random.Generator],
) -> dict[str, np.ndarray]:
    """Take the gradient steps of an update; a seed without samples takes none.

    Args:
        student: who learns.
        optimizer: its optimiser.
        samples: the student's, Â standardised, or selected ones of the teachers.
        spec: which loss, which networks, and with which numbers.
        rngs: one generator per seed, for the order of the samples.

    Returns:
        Each seed's mean losses and diagnostics over its steps, (S,) each; nan without any.

    Raises:
        DivergedError: a loss is not finite.
    """
    if student.device != HOST:
        samples, spec = samples.to(student.device), spec.to(student.device)
    with doing("learning"), one_thread():
        if compiled.applies_to(student, spec):
            return compiled.take_steps(student, optimizer, samples, spec, rngs)
        if graphs.applies_to(student, spec):
            return graphs.take_steps(student, optimizer, samples, spec, rngs)
        return epochs.take_steps(student, optimizer, samples, spec, rngs)
