"""Policies that Stable-Baselines3's PPO and A2C saved as zip files.

Their settings are JSON; what is in cloudpickle there (`:serialized:`) is not read, for SB3 writes
the same beside it as text. Where that text is incomplete, the policy is refused.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from torch import Tensor

from repaint_cli.errors import CheckpointError, reported_as
from repaint_cli.files.limits import parse, read_bytes
from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.spaces import Spaces
from repaint_cli.zoo.importers.archives import MAX_BYTES, read_members, read_tensors
from repaint_cli.zoo.importers.imported import (
    CAMERA_LAYERS,
    Imported,
    check_nothing_left,
    renamed,
    widths,
)

DATA, WEIGHTS, VERSION = "data", "policy.pth", "_stable_baselines3_version"

MAX_SETTINGS_BYTES = 16 * 2**20
"""Bytes of JSON; last observations, which may be images, are among them."""

SUPPORTED = "what can be read: PPO and A2C with MlpPolicy or CnnPolicy"

ACTIVATION_NAMES = {
    f"<class 'torch.nn.modules.activation.{name}'>": name.lower()
    for name in ("Tanh", "ReLU", "ELU")
}

EXTRACTORS = {
    f"<class 'stable_baselines3.common.torch_layers.{name}'>"
    for name in ("FlattenExtractor", "NatureCNN")
}

WITHOUT_EFFECT = {
    "ortho_init", "log_std_init", "optimizer_class", "optimizer_kwargs", "lr_schedule",
    "net_arch", "share_features_extractor", "full_std", "use_expln", ":type:", ":serialized:",
}  # fmt: skip
"""Settings of a policy that do not change what it does, or that its weights show."""

CAMERA_LAYER_NAMES = ("cnn.0", "cnn.2", "cnn.4", "linear.0")
"""SB3's names of `CAMERA_LAYERS`."""


def read(path: Path) -> tuple[Imported, bool]:
    """Read a model's zip file; nothing in it is run.

    Returns:
        The policy, and whether it was trained on what a VecNormalize gave it.

    Raises:
        CheckpointError: the file is absent or damaged, or a policy of another kind.
    """
    with reported_as(CheckpointError):
        archive = read_bytes(path, MAX_BYTES)
    parts = read_members(archive, str(path), [DATA, WEIGHTS], [VERSION])
    data = _settings(parts[DATA], path)
    tensors = read_tensors(parts[WEIGHTS], f"{path}: {WEIGHTS}")
    algorithm, spaces = _algorithm(data, path), _spaces(data, path)
    activation = _activation(_policy_settings(data, path), spaces, path)
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
        spaces, net, leaves, algorithm, seed=_count(data, "seed"),
        env_steps=_count(data, "num_timesteps"),
        versions={"stable-baselines3": _version(parts.get(VERSION, b""))},
    )  # fmt: skip
    return policy, bool(data.get("_last_original_obs"))


def _settings(text: bytes, path: Path) -> dict[str, Any]:
    if len(text) > MAX_SETTINGS_BYTES:
        raise CheckpointError(
            f"{path}: expected a '{DATA}' of {MAX_SETTINGS_BYTES:,} bytes at most, found "
            f"{len(text):,}"
        )
    with reported_as(CheckpointError):
        data = parse(text.decode("utf-8", "replace"), f"{path}: its '{DATA}'")
    if not isinstance(data, dict):
        raise CheckpointError(f"{path}: expected settings in its '{DATA}', found none")
    return data


def _algorithm(data: Mapping[str, Any], path: Path) -> str:
    """Return what trained the policy: algorithms have different settings, and no name there."""
    policy = data.get("policy_class")
    module = policy.get("__module__") if isinstance(policy, dict) else None
    if module != "stable_baselines3.common.policies":
        raise CheckpointError(f"{path}: found a policy of {str(module)[:80]}; {SUPPORTED}")
    if "clip_range" in data and "n_epochs" in data:
        return "ppo"
    if "vf_coef" in data and "gae_lambda" in data:
        return "a2c"
    raise CheckpointError(f"{path}: found settings of another algorithm; {SUPPORTED}")


def _spaces(data: Mapping[str, Any], path: Path) -> Spaces:
    """Return what a policy reads and writes, an image with its channels last, as tasks do."""
    obs, action = (_space(data.get(f"{what}_space"), path) for what in ("observation", "action"))
    shape, choice = _sizes(obs.get("_shape")), _sizes(action.get("_shape"))
    box = _is(obs, "box.Box") and len(shape) in (1, 3)
    discrete = _is(action, "discrete.Discrete") and str(action.get("start", "0")) == "0"
    if not box or not (discrete or (_is(action, "box.Box") and len(choice) == 1)):
        raise CheckpointError(
            f"{path}: expected observations in a Box, vectors or images, and actions in a Box or "
            f"Discrete from 0, found {obs[':type:']} {shape} and {action[':type:']} {choice}"
        )
    if len(shape) == 3:
        shape = (*shape[1:], shape[0])
    return Spaces(shape, _number(action.get("n"), path) if discrete else choice[0], discrete)


def _space(space: Any, path: Path) -> dict[str, Any]:
    if not isinstance(space, dict) or not isinstance(space.get(":type:"), str):
        raise CheckpointError(f"{path}: expected spaces in its '{DATA}', found none")
    return space


def _is(space: Mapping[str, Any], name: str) -> bool:
    return space[":type:"] in (
        f"<class '{library}.spaces.{name}'>" for library in ("gym", "gymnasium")
    )


def _sizes(shape: Any) -> tuple[int, ...]:
    plain = isinstance(shape, list) and all(type(n) is int and n > 0 for n in shape)
    return tuple(shape) if plain else ()


def _number(n: Any, path: Path) -> int:
    """Read n of Discrete, a text where it was one of NumPy's integers."""
    if not re.fullmatch(r"[1-9]\d{0,6}", str(n)):
        raise CheckpointError(f"{path}: expected a number of actions, found {str(n)[:40]}")
    return int(n)


def _policy_settings(data: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """Return the settings that change what a policy does, those of exploration among them."""
    kwargs = data.get("policy_kwargs")
    if not isinstance(kwargs, dict):
        raise CheckpointError(f"{path}: expected policy_kwargs in its '{DATA}', found none")
    settings = {key: value for key, value in kwargs.items() if key not in WITHOUT_EFFECT}
    return settings | ({"use_sde": data["use_sde"]} if data.get("use_sde") else {})


def _activation(settings: dict[str, Any], spaces: Spaces, path: Path) -> str:
    """Return the activation after dense layers, and check that other settings are supported."""
    activation = settings.pop("activation_fn", "<class 'torch.nn.modules.activation.Tanh'>")
    supported: dict[str, Any] = {
        "use_sde": [False],
        "squash_output": [False],
        "normalize_images": [True],
    }
    for key, value in settings.items():
        if key == "features_extractor_kwargs":
            valid = isinstance(value, dict) and value.keys() <= {"features_dim"}
        elif key == "features_extractor_class":
            valid = value in EXTRACTORS
        else:
            valid = value in supported.get(key, ()) or (
                key == "normalize_images" and not spaces.image
            )
        if not valid:
            raise CheckpointError(
                f"{path}: found a policy with {key}={str(value)[:80]}; {SUPPORTED} without it"
            )
    if activation not in ACTIVATION_NAMES:
        known = ", ".join(text.split(".")[-1].rstrip("'>") for text in ACTIVATION_NAMES)
        raise CheckpointError(
            f"{path}: expected activation_fn {known}, found {str(activation)[:80]}"
        )
    return ACTIVATION_NAMES[activation]


def _dense(
    tensors: Mapping[str, Tensor], activation: str, where: str
) -> tuple[NetConfig, dict[str, str]]:
    """Return the [net] settings of dense networks, and SB3's names of their layers by ours."""
    layers, sizes = dict[str, str](), []
    for network in ("policy", "value"):
        prefix = f"mlp_extractor.{network}_net"
        n_layers = sum(name.startswith(prefix) and name.endswith(".weight") for name in tensors)
        layers |= {f"{network}.{n}": f"{prefix}.{2 * n}" for n in range(n_layers)}
        sizes.append(widths(tensors, prefix, n_layers, where))
    hidden, of_critic = sizes
    apart = of_critic if of_critic != hidden else None
    net = {"hidden": hidden, "value_hidden": apart, "activation": activation}
    return NetConfig.model_validate(net), layers


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
