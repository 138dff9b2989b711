"""State dicts of the agents in cleanrl's PPO scripts, by the names of their layers.

A state dict holds no settings: what it does not show (tanh, grey levels divided by 255) is as the
scripts have it. Other scripts, and agents with other layers, are refused.
"""

from collections.abc import Mapping
from pathlib import Path

from torch import Tensor

from repaint_cli.errors import CheckpointError, reported_as
from repaint_cli.files.limits import read_bytes
from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.spaces import Spaces
from repaint_cli.zoo.importers.archives import MAX_BYTES, read_tensors
from repaint_cli.zoo.importers.imported import Imported
from repaint_cli.zoo.importers.layers import CAMERA_LAYERS, check_nothing_left, renamed, widths

SUPPORTED = "what can be read: ppo.py, ppo_continuous_action.py and ppo_atari.py"

TWO_PLAYERS = 6
"""Channels of the script for two players: four frames, and which player sees them."""

CRITIC = {"value.0": "critic.0", "value.1": "critic.2", "value.head": "critic.4"}
CAMERA_LAYER_NAMES = ("network.0", "network.2", "network.4", "network.7")
LAYOUTS = {
    "ppo.py": CRITIC | {"policy.0": "actor.0", "policy.1": "actor.2", "policy.head": "actor.4"},
    "ppo_continuous_action.py": CRITIC
    | {"policy.0": "actor_mean.0", "policy.1": "actor_mean.2", "policy.head": "actor_mean.4"},
    "ppo_atari.py": {"policy.head": "actor", "value.head": "critic"}
    | {
        f"{network}.{layer}": name
        for network in ("policy", "value")
        for layer, name in zip(CAMERA_LAYERS, CAMERA_LAYER_NAMES, strict=True)
    },
}
"""By script: its names of layers, by ours."""


def read(path: Path, spaces: Spaces) -> tuple[Imported, bool | None]:
    """Read an agent's state dict; nothing in it is run.

    Args:
        path: the file.
        spaces: of the task; a state dict does not say how large an image is.

    Returns:
        The policy, and True where its script normalises observations, None where a user may have
        done so; the file does not hold how.

    Raises:
        CheckpointError: the file is absent or damaged, or has the layers of no known script.
    """
    with reported_as(CheckpointError):
        data = read_bytes(path, MAX_BYTES)
    tensors = read_tensors(data, str(path))
    script = _script(tensors, path)
    layers, continuous = LAYOUTS[script], script == "ppo_continuous_action.py"
    others = {"actor_logstd"} if continuous else set[str]()
    leaves = renamed(tensors, layers, str(path))
    check_nothing_left(tensors, layers, others, str(path))
    if continuous:
        leaves["policy.log_std"] = tensors["actor_logstd"].flatten()
    n_actions = leaves["policy.head.bias"].numel()
    shape: tuple[int, ...]
    if script == "ppo_atari.py":
        shape, dense = _picture(tensors, spaces, path), leaves["policy.dense.bias"].numel()
        net = NetConfig(kind="cnn", conv="3-layer", dense=max(dense, 1), pool=1)
    else:
        shape = tuple(tensors["critic.0.weight"].shape[1:])
        actor = layers["policy.0"].partition(".")[0]
        hidden, of_critic = (
            widths(tensors, (f"{name}.0", f"{name}.2"), str(path)) for name in (actor, "critic")
        )
        net = NetConfig(hidden=hidden, value_hidden=None if of_critic == hidden else of_critic)
    return Imported(
        Spaces(shape, n_actions, not continuous), net, leaves, "ppo"
    ), continuous or None


def _picture(tensors: Mapping[str, Tensor], spaces: Spaces, path: Path) -> tuple[int, ...]:
    """Return the shape of an agent's pictures: the file says the channels, the task the rest.

    Raises:
        CheckpointError: it is the agent of a script that scales some channels alone.
    """
    first = tensors["network.0.weight"]
    channels = first.shape[1] if first.ndim == 4 else 0
    if channels == TWO_PLAYERS:
        raise CheckpointError(
            f"{path}: found pictures of {channels} channels, as ppo_pettingzoo_ma_atari.py has "
            f"them, which divides only four of them by 255; {SUPPORTED}"
        )
    if not spaces.image:
        return 84, 84, channels
    first_is_channels = spaces.obs_shape[0] == channels != spaces.obs_shape[2]
    height, width = spaces.obs_shape[1:] if first_is_channels else spaces.obs_shape[:2]
    return height, width, channels


def _script(tensors: Mapping[str, Tensor], path: Path) -> str:
    """Return the script that a state dict is from."""
    for script, layers in LAYOUTS.items():
        logstd = ("actor_logstd" in tensors) == (script == "ppo_continuous_action.py")
        if logstd and all(f"{layer}.weight" in tensors for layer in layers.values()):
            return script
    names = ", ".join(sorted(tensors)[:4]) or "nothing"
    raise CheckpointError(f"{path}: found parameters {names}, … of another script; {SUPPORTED}")
