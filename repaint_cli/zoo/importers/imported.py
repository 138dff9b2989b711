"""A policy of another library, and the teacher made of it."""

from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from math import inf, isinf
from typing import Any

import gymnasium
import numpy as np
import torch
from torch import Tensor

from repaint_cli.errors import TeacherMismatch, UsageError
from repaint_cli.files.provenance import versions
from repaint_cli.policies import weights
from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.parameters import leaves_of
from repaint_cli.policies.spaces import Spaces
from repaint_cli.tasks.card import TaskCard
from repaint_cli.zoo import store
from repaint_cli.zoo.importers import fit
from repaint_cli.zoo.importers.statistics import Statistics
from repaint_cli.zoo.scoring import score
from repaint_cli.zoo.teacher_card import TeacherCard


@dataclass(frozen=True)
class Imported:
    """A policy and its critic, read from another library's file."""

    spaces: Spaces
    """Of its observations and actions."""
    net: NetConfig
    """Its layers."""
    leaves: dict[str, Tensor]
    """Their parameters, by our names."""
    algorithm: str
    """That trained it."""
    bounds: fit.Bounds | None = None
    """Of its actions; None where they are numbers, or a file does not say."""
    obs_bounds: fit.Bounds | None = None
    """Of its observations, where it was trained; None where a file does not say."""
    seed: int = 0
    """Of its training; 0 where the file has none."""
    env_steps: int = 0
    """That it was trained for; 0 where the file has no count."""
    versions: dict[str, str] = field(default_factory=dict)
    """Of the libraries that made it."""


def as_teacher(
    policy: Imported,
    statistics: Statistics | None,
    name: str,
    task: TaskCard,
    env_spaces: tuple[gymnasium.Space, gymnasium.Space],  # type: ignore[type-arg]
    *,
    rescale: bool = False,
) -> tuple[ActorCritic, TeacherCard]:
    """Make an imported policy a teacher of a task, and score it there.

    Args:
        policy: from another library.
        statistics: of its normalised observations; None where it normalises none.
        name: of the teacher.
        task: that it was trained on.
        env_spaces: of the task's observations and actions, see `environment_spaces`.
        rescale: whether its actions are to be rescaled from its bounds to the task's.

    Raises:
        TeacherMismatch: the policy or the statistics do not fit the task.
        UsageError: statistics are given for a policy of images, or actions cannot be rescaled.
        CardError: the task's environment cannot be made.
    """
    spaces, (net, normalizer) = Spaces.of(*env_spaces), _normalizer(policy, statistics)
    card = _card(policy, name, task.model_copy(update={"net": net}))
    problem = fit.channels_first(policy.spaces, spaces) or store.mismatch(card, task, spaces)
    if problem:
        raise TeacherMismatch(f"{problem}; give the --task it was trained on")
    _check_leaves(policy, card)
    policy = _fitted(policy, f"teacher '{name}'", *env_spaces, rescale=rescale)
    network = ActorCritic(spaces, net, 1)
    weights.load_policy(network, policy.leaves | normalizer, f"teacher '{name}'")
    return network, card.model_copy(update={"score": score(network, task, policy.seed)})


def _card(policy: Imported, name: str, task: TaskCard) -> TeacherCard:
    """Return the card of an imported policy, without a score."""
    return TeacherCard(
        name=name,
        task=task,
        obs_shape=policy.spaces.obs_shape,
        n_actions=policy.spaces.n_actions,
        discrete=policy.spaces.discrete,
        algorithm=policy.algorithm,
        method="imported",
        seed=policy.seed,
        iteration=0,
        env_steps=policy.env_steps,
        versions=versions() | policy.versions,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
    )


def _fitted(
    policy: Imported,
    where: str,
    obs: gymnasium.Space,  # type: ignore[type-arg]
    action: gymnasium.Space,  # type: ignore[type-arg]
    *,
    rescale: bool,
) -> Imported:
    """Return the policy with the actions of a task.

    Raises:
        TeacherMismatch: it reads other pixels, or its actions have other bounds.
        UsageError: its bounds, to rescale from, are not known.
    """
    if policy.spaces.image and (problem := fit.other_pixels(obs)):
        raise TeacherMismatch(f"{where}: {problem}")
    if policy.bounds is None or not isinstance(action, gymnasium.spaces.Box):
        if rescale:
            raise UsageError(
                "expected --rescale-actions with a file that has the bounds of continuous actions, "
                "found none"
            )
        return policy
    space = fit.Bounds.of(action)
    if rescale:
        return replace(policy, leaves=fit.rescaled(policy.leaves, policy.bounds, space, where))
    if problem := fit.other_bounds(policy.bounds, space):
        raise TeacherMismatch(
            f"{where}: {problem}; give the --task it was trained on, or --rescale-actions if it "
            "was trained behind gymnasium's RescaleAction"
        )
    return policy


def _normalizer(
    policy: Imported, statistics: Statistics | None
) -> tuple[NetConfig, dict[str, Tensor]]:
    """Return the layers with the normaliser's bounds, and its statistics as leaves."""
    if policy.spaces.image:
        if statistics:
            raise UsageError("expected no statistics of images, found some: --vecnormalize none")
        return policy.net, {}
    n = policy.spaces.obs_shape[0]
    net: dict[str, Any] = {"obs_normalize": False}
    if statistics:
        clip = "none" if isinf(statistics.clip) else statistics.clip
        net = {"obs_clip": clip, "obs_min_std": 0.0}
    else:
        statistics = Statistics(np.zeros(n), np.ones(n), inf)
    mean, var = torch.from_numpy(statistics.mean), torch.from_numpy(statistics.var)
    if len(mean) != n:
        raise TeacherMismatch(f"the policy reads {n} numbers, the statistics are of {len(mean)}")
    state = {"mean": mean, "var": var, "count": torch.tensor(statistics.count, dtype=torch.float64)}
    leaves = {f"normalizer.{name}": tensor for name, tensor in state.items()}
    return policy.net.model_copy(update=net), leaves


def _check_leaves(policy: Imported, card: TeacherCard) -> None:
    """Check every leaf's shape before memory is allocated for any."""
    networks = leaves_of(policy.spaces, card.task.net)
    expected = {leaf.name: leaf.shape for leaf in networks["policy"] + networks["value"]}
    for name in sorted(expected.keys() | policy.leaves.keys()):
        shape = tuple(policy.leaves[name].shape) if name in policy.leaves else "absent"
        if shape != expected.get(name, "absent"):
            raise TeacherMismatch(
                f"teacher '{card.name}': '{name}' is {shape}, for {policy.spaces} it must be "
                f"{expected.get(name, 'absent')}"
            )
