"""Policies that Stable-Baselines3's PPO and A2C, and sb3-contrib's TRPO, saved as zip files."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from torch import Tensor

from repaint_cli.errors import CheckpointError, reported_as
from repaint_cli.files.limits import read_bytes
from repaint_cli.policies.architecture import NetConfig
from repaint_cli.zoo.importers.archives import MAX_BYTES, read_members, read_tensors
from repaint_cli.zoo.importers.imported import Imported
from repaint_cli.zoo.importers.layers import CAMERA_LAYERS, check_nothing_left, renamed, widths
from repaint_cli.zoo.importers.sb3_settings import (
    DATA,
    SUPPORTED,
    activation_of,
    algorithm_of,
    observation_bounds,
    settings_of,
    spaces_of,
)

WEIGHTS, VERSION = "policy.pth", "_stable_baselines3_version"

CAMERA_LAYER_NAMES = ("cnn.0", "cnn.2", "cnn.4", "linear.0")
"""SB3's names of `CAMERA_LAYERS`."""


def read(path: Path) -> tuple[Imported, bool | None]:
    """Read a model's zip file; nothing in it is run.

    Returns:
        The policy, and whether it was trained on what a VecNormalize gave it; None before any
        training.

    Raises:
        CheckpointError: the file is absent or damaged, or a policy of another kind.
    """
    with reported_as(CheckpointError):
        archive = read_bytes(path, MAX_BYTES)
    parts = read_members(archive, str(path), [DATA, WEIGHTS], [VERSION])
    data = settings_of(parts[DATA], path)
    tensors = read_tensors(parts[WEIGHTS], f"{path}: {WEIGHTS}")
    algorithm, (spaces, bounds) = algorithm_of(data, path), spaces_of(data, path)
    activation = activation_of(data, spaces, path)
    if spaces.image:
        net, layers = _camera(tensors, str(path))
    else:
        net, layers = _dense(tensors, activation, str(path))
    layers |= {"policy.head": "action_net", "value.head": "value_net"}
    leaves = renamed(tensors, layers, str(path))
    if not spaces.discrete and "log_std" in tensors:
        leaves["policy.log_std"] = tensors["log_std"]
    others = {name for name in tensors if spaces.image and name.startswith("features_extractor.")}
    check_nothing_left(
        tensors, layers, others | (set() if spaces.discrete else {"log_std"}), str(path)
    )
    policy = Imported(
        spaces, net, leaves, algorithm, bounds, obs_bounds=observation_bounds(data, spaces),
        seed=_count(data, "seed"),
        env_steps=_count(data, "num_timesteps"),
        versions={"stable-baselines3": _version(parts.get(VERSION, b""))},
    )  # fmt: skip
    raw, trained = (bool(data.get(name)) for name in ("_last_original_obs", "_last_obs"))
    return policy, True if raw else False if trained else None


def _dense(
    tensors: Mapping[str, Tensor], activation: str, where: str
) -> tuple[NetConfig, dict[str, str]]:
    """Return the [net] settings of dense networks, and SB3's names of their layers by ours.

    In SB3 1 policy and critic may share their first layers; here each has a copy.
    """
    layers, sizes = dict[str, str](), []
    for network in ("policy", "value"):
        names = _sequence(tensors, "mlp_extractor.shared_net")
        names += _sequence(tensors, f"mlp_extractor.{network}_net")
        layers |= {f"{network}.{n}": name for n, name in enumerate(names)}
        sizes.append(widths(tensors, names, where))
    hidden, of_critic = sizes
    apart = of_critic if of_critic != hidden else None
    net = {"hidden": hidden, "value_hidden": apart, "activation": activation}
    return NetConfig.model_validate(net), layers


def _sequence(tensors: Mapping[str, Tensor], prefix: str) -> list[str]:
    """Return the names of dense layers with activations between them: prefix.0, prefix.2 ff."""
    n_layers = sum(name.startswith(f"{prefix}.") and name.endswith(".weight") for name in tensors)
    return [f"{prefix}.{2 * n}" for n in range(n_layers)]


def _camera(tensors: Mapping[str, Tensor], where: str) -> tuple[NetConfig, dict[str, str]]:
    """Return the [net] settings of SB3's NatureCNN, and SB3's names of its layers by ours.

    Policy and critic may share it in SB3; here each has a copy, since ours share no dense layer.
    """
    if not any(name.startswith(("features_", "pi_features_")) for name in tensors):
        raise CheckpointError(f"{where}: found images read without a camera network; {SUPPORTED}")
    if any(name.startswith("mlp_extractor.") for name in tensors):
        raise CheckpointError(
            f"{where}: found dense layers (net_arch) behind the camera network; {SUPPORTED} without"
        )
    own = any(name.startswith("pi_features_extractor.") for name in tensors)
    prefixes = {"policy": "pi_", "value": "vf_"} if own else {"policy": "", "value": ""}
    layers = {
        f"{network}.{layer}": f"{prefix}features_extractor.{name}"
        for network, prefix in prefixes.items()
        for layer, name in zip(CAMERA_LAYERS, CAMERA_LAYER_NAMES, strict=True)
    }
    last = tensors.get(f"{layers['policy.dense']}.bias")
    if last is None or not last.numel():
        raise CheckpointError(
            f"{where}: expected SB3's NatureCNN before an image's policy, found none"
        )
    return NetConfig(kind="cnn", conv="3-layer", dense=last.numel(), pool=1), layers


def _count(data: Mapping[str, Any], key: str) -> int:
    count = data.get(key)
    return count if type(count) is int and 0 <= count < 2**53 else 0


def _version(text: bytes) -> str:
    version = text.decode("ascii", "replace").strip()
    return version if re.fullmatch(r"[\w.+-]{1,32}", version) else "unknown"
