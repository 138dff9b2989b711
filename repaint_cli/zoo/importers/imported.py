"""What every reader of foreign policies returns, and how a teacher is made of it."""

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
from repaint_cli.policies.networks import ActorCritic, leaves_of
from repaint_cli.policies.spaces import Spaces
from repaint_cli.provenance import versions
from repaint_cli.tasks.card import TaskCard
from repaint_cli.zoo import store
from repaint_cli.zoo.importers.statistics import Statistics
from repaint_cli.zoo.scoring import score
from repaint_cli.zoo.teacher_card import TeacherCard

CAMERA = ("conv0", "conv1", "conv2", "dense")
"""Our names of the layers of the camera network that Stable-Baselines3 and cleanrl have, too."""


@dataclass(frozen=True)
class Imported:
    """A policy and its critic from elsewhere."""

    spaces: Spaces
    """What it reads and writes."""
    net: NetConfig
    """Its networks."""
    leaves: dict[str, Tensor]
    """Their parameters, by our names."""
    algorithm: str
    """What trained it."""
    seed: int = 0
    """Its seed, 0 where it does not say."""
    env_steps: int = 0
    """Environment steps it had taken, 0 where it does not say."""
    versions: dict[str, str] = field(default_factory=dict)
    """Of the libraries it was made with."""


def as_teacher(
    policy: Imported, statistics: Statistics | None, name: str, task: TaskCard
) -> tuple[ActorCritic, TeacherCard]:
    """Make a foreign policy a teacher of a task, and score it there.

    Args:
        policy: what was read.
        statistics: how it saw its observations; None as they are.
        name: what the teacher is to be called.
        task: what it was trained on.

    Raises:
        TeacherMismatch: it does not fit the task.
        UsageError: statistics are given for a policy of images.
        CardError: the task's environment cannot be made.
    """
    spaces, (net, seen) = spaces_of(task), _sight(policy, statistics)
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
    if problem := store.misfit(card, task, spaces):
        raise TeacherMismatch(f"{problem}; give the --task it was trained on")
    _check_leaves(policy, card)
    network = ActorCritic(spaces, net, 1)
    weights.load_policy(network, policy.leaves | seen, f"teacher '{name}'")
    return network, card.model_copy(update={"score": score(network, task, policy.seed)})


def _sight(policy: Imported, statistics: Statistics | None) -> tuple[NetConfig, dict[str, Tensor]]:
    """Return the networks with the normaliser's bounds, and its statistics as parameters."""
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
    seen = {"mean": mean, "var": var, "count": torch.tensor(count or 0.0, dtype=torch.float64)}
    leaves = {f"normalizer.{name}": tensor for name, tensor in seen.items()}
    return policy.net.model_copy(update=bounds), leaves


def _check_leaves(policy: Imported, card: TeacherCard) -> None:
    """Check every parameter's shape before there is room for any."""
    towers = leaves_of(policy.spaces, card.task.net)
    wanted = {leaf.name: leaf.shape for leaf in towers["policy"] + towers["value"]}
    for name in sorted(wanted.keys() | policy.leaves.keys()):
        found = tuple(policy.leaves[name].shape) if name in policy.leaves else "absent"
        if found != wanted.get(name, "absent"):
            raise TeacherMismatch(
                f"teacher '{card.name}': '{name}' is {found}, for {policy.spaces} it must be "
                f"{wanted.get(name, 'absent')}"
            )


def renamed(
    found: Mapping[str, Tensor], layers: Mapping[str, str], where: str
) -> dict[str, Tensor]:
    """Return layers under our names, dense ones with their inputs first, as we have them.

    Args:
        found: parameters by their names elsewhere.
        layers: their layers by ours.
        where: what to call the file in an error.

    Raises:
        CheckpointError: a parameter is missing.
    """
    leaves = {}
    for ours, theirs in layers.items():
        for part in ("weight", "bias"):
            tensor = found.get(f"{theirs}.{part}")
            if tensor is None:
                raise CheckpointError(f"{where}: expected '{theirs}.{part}', found none")
            leaves[f"{ours}.{part}"] = tensor.T if tensor.ndim == 2 else tensor
    return leaves


def check_nothing_left(
    found: Mapping[str, Tensor], used: Mapping[str, str], others: set[str], where: str
) -> None:
    """Check that every parameter of a file has its place.

    Args:
        found: parameters by their names elsewhere.
        used: their layers by ours.
        others: parameters that are no layers', or are there twice.
        where: what to call the file in an error.

    Raises:
        CheckpointError: one has none.
    """
    known = {f"{theirs}.{part}" for theirs in used.values() for part in ("weight", "bias")}
    for name in sorted(found.keys() - known - others):
        raise CheckpointError(f"{where}: '{name}' belongs to no policy that can be read here")


def widths(found: Mapping[str, Tensor], prefix: str, n_layers: int, where: str) -> tuple[int, ...]:
    """Return how wide dense layers with activations between them are.

    Args:
        found: parameters by their names elsewhere: prefix.0, prefix.2, …
        prefix: of the layers.
        n_layers: how many of them.
        where: what to call the file in an error.

    Raises:
        CheckpointError: one is missing, or nothing wide.
    """
    names = [f"{prefix}.{2 * layer}.bias" for layer in range(n_layers)]
    for name in names:
        if name not in found or found[name].ndim != 1 or not len(found[name]):
            raise CheckpointError(f"{where}: expected a layer's '{name}', found none")
    return tuple(len(found[name]) for name in names)
