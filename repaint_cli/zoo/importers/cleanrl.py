"""State dicts of the agents in cleanrl's PPO scripts, by the names of their layers.

A state dict holds no settings: what it does not show (tanh, grey levels divided by 255) is as the
scripts have it. Other scripts, and agents with other layers, are refused.
"""

from collections.abc import Mapping
from pathlib import Path

from torch import Tensor

from repaint_cli.errors import CheckpointError
from repaint_cli.files.limits import read_bytes
from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.spaces import Spaces
from repaint_cli.zoo.importers.archives import LARGEST, read_tensors
from repaint_cli.zoo.importers.imported import CAMERA, Imported, check_nothing_left, renamed, widths

WORKS = "what can be read: ppo.py, ppo_continuous_action.py and ppo_atari.py"

CRITIC = {"value.0": "critic.0", "value.1": "critic.2", "value.head": "critic.4"}
EYES = ("network.0", "network.2", "network.4", "network.7")
LAYOUTS = {
    "ppo.py": CRITIC | {"policy.0": "actor.0", "policy.1": "actor.2", "policy.head": "actor.4"},
    "ppo_continuous_action.py": CRITIC
    | {"policy.0": "actor_mean.0", "policy.1": "actor_mean.2", "policy.head": "actor_mean.4"},
    "ppo_atari.py": {"policy.head": "actor", "value.head": "critic"}
    | {
        f"{tower}.{ours}": theirs
        for tower in ("policy", "value")
        for ours, theirs in zip(CAMERA, EYES, strict=True)
    },
}
"""The scripts, and their layers' names there by ours."""


def read(path: Path, spaces: Spaces) -> tuple[Imported, bool]:
    """Read an agent's state dict; nothing in it is run.

    Args:
        path: the file.
        spaces: of the task; a state dict does not say how large an image is.

    Returns:
        The policy, and whether its script normalised what it saw, which the file does not hold.

    Raises:
        CheckpointError: the file is absent or damaged, or of another layout.
    """
    found = read_tensors(read_bytes(path, CheckpointError, LARGEST), str(path))
    script = _script(found, path)
    layers, continuous = LAYOUTS[script], script == "ppo_continuous_action.py"
    others = {"actor_logstd"} if continuous else set[str]()
    leaves = renamed(found, layers, str(path))
    check_nothing_left(found, layers, others, str(path))
    if continuous:
        leaves["policy.log_std"] = found["actor_logstd"].flatten()
    n_actions = leaves["policy.head.bias"].numel()
    shape: tuple[int, ...]
    if script == "ppo_atari.py":
        height, width = spaces.obs_shape[:2] if spaces.image else (84, 84)
        first, dense = found["network.0.weight"], leaves["policy.dense.bias"].numel()
        shape = (height, width, first.shape[1] if first.ndim == 4 else 0)
        net = NetConfig(kind="cnn", conv="3-layer", dense=max(dense, 1), pool=1)
    else:
        shape = tuple(found["critic.0.weight"].shape[1:])
        actor = layers["policy.0"].partition(".")[0]
        hidden, of_critic = (widths(found, name, 2, str(path)) for name in (actor, "critic"))
        net = NetConfig(hidden=hidden, value_hidden=None if of_critic == hidden else of_critic)
    return Imported(Spaces(shape, n_actions, not continuous), net, leaves, "ppo"), continuous


def _script(found: Mapping[str, Tensor], path: Path) -> str:
    """Tell from which script a state dict is."""
    for script, layers in LAYOUTS.items():
        logstd = ("actor_logstd" in found) == (script == "ppo_continuous_action.py")
        if logstd and all(f"{theirs}.weight" in found for theirs in layers.values()):
            return script
    names = ", ".join(sorted(found)[:4]) or "nothing"
    raise CheckpointError(f"{path}: found parameters {names}, … of another script; {WORKS}")
