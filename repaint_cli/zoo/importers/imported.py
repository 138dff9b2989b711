"""A policy of another library, and the teacher made of it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from math import isinf

import torch
from torch import Tensor

from repaint_cli.errors import CheckpointError, TeacherMismatch, UsageError
from repaint_cli.learn.evaluation import spaces_of
from repaint_cli.policies import weights
from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.parameters import leaves_of
from repaint_cli.policies.spaces import Spaces
from repaint_cli.provenance import versions
from repaint_cli.tasks.card import TaskCard
from repaint_cli.zoo import store
from repaint_cli.zoo.importers.statistics import Statistics
from repaint_cli.zoo.scoring import score
from repaint_cli.zoo.teacher_card import TeacherCard

CAMERA_LAYERS = ("conv0", "conv1", "conv2", "dense")
"""Our names of the layers of the NatureCNN, which Stable-Baselines3 and cleanrl have too."""


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
    seed: int = 0
    """Of its training; 0 where the file has none."""
    env_steps: int = 0
    """That it was trained for; 0 where the file has no count."""
    versions: dict[str, str] = field(default_factory=dict)
    """Of the libraries that made it."""


def as_teacher(
    policy: Imported, statistics: Statistics | None, name: str, task: TaskCard
) -> tuple[ActorCritic, TeacherCard]:
    """Make an imported policy a teacher of a task, and score it there.

    Args:
        policy: from another library.
        statistics: of its normalised observations; None where it normalises none.
        name: of the teacher.
        task: that it was trained on.

    Raises:
        TeacherMismatch: the policy or the statistics do not fit the task.
        UsageError: statistics are given for a policy of images.
        CardError: the task's environment cannot be made.
    """
    spaces, (net, normalizer) = spaces_of(task), _normalizer(policy, statistics)
    card = TeacherCard(
        name=name,
        task=task.model_copy(update={"net": net}),
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
    if problem := store.mismatch(card, task, spaces):
        raise TeacherMismatch(f"{problem}; give the --task it was trained on")
    _check_leaves(policy, card)
    network = ActorCritic(spaces, net, 1)
    weights.load_policy(network, policy.leaves | normalizer, f"teacher '{name}'")
    return network, card.model_copy(update={"score": score(network, task, policy.seed)})


def _normalizer(
    policy: Imported, statistics: Statistics | None
) -> tuple[NetConfig, dict[str, Tensor]]:
    """Return the layers with the normaliser's bounds, and its statistics as leaves."""
    if policy.spaces.image:
        if statistics:
            raise UsageError("expected no statistics of images, found some: --vecnormalize none")
        return policy.net, {}
    n = policy.spaces.obs_shape[0]
    mean, var = torch.zeros(n, dtype=torch.float64), torch.ones(n, dtype=torch.float64)
    count = clip = None
    if statistics:
        mean, var = torch.from_numpy(statistics.mean), torch.from_numpy(statistics.var)
        count, clip = statistics.count, None if isinf(statistics.clip) else statistics.clip
        if len(mean) != n:
            raise TeacherMismatch(
                f"the policy reads {n} numbers, the statistics are of {len(mean)}"
            )
    bounds = {"obs_clip": clip or "none", "obs_min_std": 0.0}
    state = {"mean": mean, "var": var, "count": torch.tensor(count or 0.0, dtype=torch.float64)}
    leaves = {f"normalizer.{name}": tensor for name, tensor in state.items()}
    return policy.net.model_copy(update=bounds), leaves


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


def renamed(
    tensors: Mapping[str, Tensor], layers: Mapping[str, str], where: str
) -> dict[str, Tensor]:
    """Return layers by our names, dense ones transposed, so that their inputs come first.

    Args:
        tensors: of the file, by the library's names.
        layers: the library's names of layers, by ours.
        where: the file's name, for messages.

    Raises:
        CheckpointError: a parameter is missing.
    """
    leaves = {}
    for layer, name in layers.items():
        for part in ("weight", "bias"):
            tensor = tensors.get(f"{name}.{part}")
            if tensor is None:
                raise CheckpointError(f"{where}: expected '{name}.{part}', found none")
            leaves[f"{layer}.{part}"] = tensor.T if tensor.ndim == 2 else tensor
    return leaves


def check_nothing_left(
    tensors: Mapping[str, Tensor], layers: Mapping[str, str], others: set[str], where: str
) -> None:
    """Check that every tensor of a file is used.

    Args:
        tensors: of the file, by the library's names.
        layers: the library's names of layers, by ours.
        others: tensors that belong to no layer, or are copies.
        where: the file's name, for messages.

    Raises:
        CheckpointError: a tensor is neither a layer's nor one of the others.
    """
    known = {f"{name}.{part}" for name in layers.values() for part in ("weight", "bias")}
    for name in sorted(tensors.keys() - known - others):
        raise CheckpointError(f"{where}: '{name}' belongs to no policy that can be read here")


def widths(
    tensors: Mapping[str, Tensor], prefix: str, n_layers: int, where: str
) -> tuple[int, ...]:
    """Return the widths of dense layers with activations between them.

    Args:
        tensors: of the file, by the library's names: prefix.0, prefix.2, …
        prefix: of the layers.
        n_layers: their number.
        where: the file's name, for messages.

    Raises:
        CheckpointError: a layer's bias is missing, empty, or no vector.
    """
    names = [f"{prefix}.{2 * layer}.bias" for layer in range(n_layers)]
    for name in names:
        if name not in tensors or tensors[name].ndim != 1 or not len(tensors[name]):
            raise CheckpointError(f"{where}: expected a layer's '{name}', found none")
    return tuple(len(tensors[name]) for name in names)
