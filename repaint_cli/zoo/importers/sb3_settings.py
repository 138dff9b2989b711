"""The settings in a zip file of Stable-Baselines3: the algorithm, the spaces, the layers.

They are JSON; what is in cloudpickle there (`:serialized:`) is not read, for SB3 writes the same
beside it as text. Where that text is incomplete, the policy is refused.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from repaint_cli.errors import CheckpointError, reported_as
from repaint_cli.files.limits import parse
from repaint_cli.policies.spaces import Spaces
from repaint_cli.zoo.importers.fit import Bounds

DATA = "data"
"""The part of the zip file."""

MAX_SETTINGS_BYTES = 16 * 2**20
"""Bytes of JSON; last observations, which may be images, are among them."""

SUPPORTED = "what can be read: PPO, A2C and TRPO with MlpPolicy or CnnPolicy"

MODULES = {
    "stable_baselines3.dqn.policies": "DQN",
    "stable_baselines3.sac.policies": "SAC",
    "stable_baselines3.td3.policies": "TD3 or DDPG",
    "sb3_contrib.ars.policies": "ARS",
    "sb3_contrib.common.maskable.policies": "MaskablePPO",
    "sb3_contrib.common.recurrent.policies": "RecurrentPPO",
    "sb3_contrib.crossq.policies": "CrossQ",
    "sb3_contrib.qrdqn.policies": "QRDQN",
    "sb3_contrib.tqc.policies": "TQC",
}
"""Modules of policies that have no teacher's form: they squash actions, have values of actions in
place of probabilities, remember, or must not take every action."""

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


def settings_of(text: bytes, path: Path) -> dict[str, Any]:
    """Return the settings in a zip file's part.

    Raises:
        CheckpointError: the part is too large, or damaged.
    """
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


def algorithm_of(data: Mapping[str, Any], path: Path) -> str:
    """Return what trained the policy: algorithms have different settings, and no name there.

    Raises:
        CheckpointError: its policy is another one than PPO's, which A2C and TRPO have too.
    """
    module = _module(data, "policy_class")
    if module != "stable_baselines3.common.policies":
        hindsight = _module(data, "replay_buffer_class").startswith("stable_baselines3.her.")
        known = MODULES.get(module, module[:80]) + (" with HER" if hindsight else "")
        raise CheckpointError(f"{path}: found a policy of {known}; {SUPPORTED}")
    if "clip_range" in data and "n_epochs" in data:
        return "ppo"
    if "vf_coef" in data and "gae_lambda" in data:
        return "trpo" if "cg_max_steps" in data else "a2c"
    raise CheckpointError(f"{path}: found settings of another algorithm; {SUPPORTED}")


def _module(data: Mapping[str, Any], key: str) -> str:
    """Return the module of a class among the settings, or "None"."""
    described = data.get(key)
    return str(described.get("__module__") if isinstance(described, dict) else None)


def spaces_of(data: Mapping[str, Any], path: Path) -> tuple[Spaces, Bounds | None]:
    """Return what a policy reads and writes, an image with its channels last, as tasks do.

    SB3 transposes images before its policies read them, so that there their channels come first.

    Returns:
        The sizes, and the bounds of continuous actions.

    Raises:
        CheckpointError: no policy here has such spaces.
    """
    obs, action = (_space(data.get(f"{what}_space"), path) for what in ("observation", "action"))
    shape, choice = _sizes(obs), _sizes(action)
    box = _is(obs, "box.Box") and len(shape) in (1, 3)
    discrete = _is(action, "discrete.Discrete") and str(action.get("start", "0")) == "0"
    if not box or not (discrete or (_is(action, "box.Box") and len(choice) == 1)):
        raise CheckpointError(
            f"{path}: expected observations in a Box, vectors or images, and actions in a Box or "
            f"Discrete from 0, found {obs[':type:']} {shape} and {action[':type:']} {choice}"
        )
    if len(shape) == 3:
        shape = (*shape[1:], shape[0])
    if discrete:
        return Spaces(shape, _number(action.get("n"), path), True), None
    bounds = _bounds(action, choice[0])
    if bounds is None:
        low, high = (" ".join(str(action.get(name))[:40].split()) for name in ("low", "high"))
        raise CheckpointError(
            f"{path}: expected the bounds of {choice[0]} actions, found {low} and {high}"
        )
    return Spaces(shape, choice[0], False), bounds


def observation_bounds(data: Mapping[str, Any], spaces: Spaces) -> Bounds | None:
    """Return the bounds of a vector's numbers, or None where they cannot be read."""
    return None if spaces.image else _bounds(data["observation_space"], spaces.obs_shape[0])


def _bounds(space: Mapping[str, Any], n: int) -> Bounds | None:
    """Return the bounds of n numbers, which are texts as NumPy prints arrays; None without."""
    texts = [str(space.get(name)).strip("[]").split() for name in ("low", "high")]
    try:
        low, high = (np.array([float(text) for text in numbers]) for numbers in texts)
    except ValueError:
        return None
    sound = low.shape == high.shape == (n,) and bool((low <= high).all())
    return Bounds(low, high) if sound else None


def _space(space: Any, path: Path) -> dict[str, Any]:
    if not isinstance(space, dict) or not isinstance(space.get(":type:"), str):
        raise CheckpointError(f"{path}: expected spaces in its '{DATA}', found none")
    return space


def _is(space: Mapping[str, Any], name: str) -> bool:
    return space[":type:"] in (
        f"<class '{library}.spaces.{name}'>" for library in ("gym", "gymnasium")
    )


def _sizes(space: Mapping[str, Any]) -> tuple[int, ...]:
    shape = space.get("_shape", space.get("shape"))  # gym's first versions have the latter
    plain = isinstance(shape, list) and all(type(n) is int and n > 0 for n in shape)
    return tuple(shape) if plain else ()


def _number(n: Any, path: Path) -> int:
    """Read n of Discrete, a text where it was one of NumPy's integers."""
    if not re.fullmatch(r"[1-9]\d{0,6}", str(n)):
        raise CheckpointError(f"{path}: expected a number of actions, found {str(n)[:40]}")
    return int(n)


def activation_of(data: Mapping[str, Any], spaces: Spaces, path: Path) -> str:
    """Return the activation after dense layers, and check that other settings are supported.

    Raises:
        CheckpointError: a setting changes what the policy does, so that it cannot be read.
    """
    kwargs = data.get("policy_kwargs")
    if not isinstance(kwargs, dict):
        raise CheckpointError(f"{path}: expected policy_kwargs in its '{DATA}', found none")
    settings = {key: value for key, value in kwargs.items() if key not in WITHOUT_EFFECT}
    settings |= {"use_sde": data["use_sde"]} if data.get("use_sde") else {}
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
