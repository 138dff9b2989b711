"""DeepRacer's own files of settings, as settings of a card, and back."""

from collections.abc import Mapping
from contextlib import suppress
from math import isfinite
from pathlib import Path
from typing import Any

from repaint_cli.envs.racer.actions import ActionRanges, Actions
from repaint_cli.errors import CardError, reported_as
from repaint_cli.files.limits import read_json
from repaint_cli.settings import PPOConfig

CAMERA_NAMES = {
    "observation": "camera",
    "FRONT_FACING_CAMERA": "camera",
    "LEFT_CAMERA": "camera",
    "STEREO_CAMERAS": "stereo",
}
SENSOR_NAMES = {frozenset({name}): camera for name, camera in CAMERA_NAMES.items()} | {
    frozenset({name, "LIDAR"}): f"{camera}+lidar" for name, camera in CAMERA_NAMES.items()
}
"""What a car may carry, and what we call it."""


PPO_NAMES = {
    "batch_size": "minibatch_size",
    "beta_entropy": "ent_coef",
    "discount_factor": "gamma",
    "lr": "learning_rate",
    "num_episodes_between_training": "n_episodes",
    "num_epochs": "n_epochs",
}
"""DeepRacer's hyper-parameters, and the fields of `PPOConfig` that mean the same."""

DRAWN = "actions are drawn from the policy"
END = "ppo.n_iterations says when to stop"
OTHER_NAMES: dict[str, tuple[Any, str]] = {
    "e_greedy_value": (None, DRAWN),
    "epsilon_steps": (None, DRAWN),
    "exploration_type": ("categorical", DRAWN),
    "loss_type": ("mean squared error", "the critic's loss is the mean squared error"),
    "sac_alpha": (None, "there is no SAC"),
    "stack_size": (1, "a policy sees one image"),
    "term_cond_avg_score": (None, END),
    "term_cond_max_episodes": (None, END),
}
"""Those that are not read: the value that says what is done anyway, if any, and what is done."""
METADATA = {"action_space", "action_space_type", "sensor", "version"}
"""The keys of a `model_metadata.json` that are read, or that say what `action_space` shows."""
NETWORKS = {
    "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW": ("3-layer", "3-layer"),
    "DEEP_CONVOLUTIONAL_NETWORK": ("4-layer", "5-layer"),
    "DEEP_CONVOLUTIONAL_NETWORK_DEEP": ("5-layer", "5-layer"),
}
"""What `net.conv` calls DeepRacer's networks, of one camera and of two."""


def read_hyperparameters(path: Path) -> dict[str, Any]:
    """Return the [ppo] settings that a `hyperparameters.json` stands for.

    Raises:
        CardError: the file cannot be read, or has a key that is not DeepRacer's.
    """
    data = _read_object(path)
    unknown = sorted(data.keys() - PPO_NAMES.keys() - OTHER_NAMES.keys())
    if unknown:
        known = ", ".join(sorted({*PPO_NAMES, *OTHER_NAMES}))
        raise CardError(f"{path}: unknown key '{unknown[0]:.60}'; DeepRacer's are {known}")
    return {field: _number(data[name]) for name, field in PPO_NAMES.items() if name in data}


def unread_hyperparameters(path: Path, ppo: Mapping[str, Any]) -> str | None:
    """Return which keys of a `hyperparameters.json` are not taken over, and why; None if all are.

    Args:
        path: of a file that `read_hyperparameters` has read.
        ppo: the card's own settings in [ppo], which outrank the file's.
    """
    unread: dict[str, list[str]] = {}
    for name, value in _read_object(path).items():
        same, why = OTHER_NAMES.get(name, (None, ""))
        if name in OTHER_NAMES and (same is None or _number(value) != same):
            unread.setdefault(why, []).append(f"{name} = {value!s:.40}")
        elif name == "num_episodes_between_training" and "n_steps" in ppo:
            unread.setdefault("ppo.n_steps says how long a rollout is", []).append(name)
    parts = [f"{', '.join(names)} ({why})" for why, names in unread.items()]
    return f"{path}: not read: {'; '.join(parts)}" if parts else None


def hyperparameters(ppo: PPOConfig) -> dict[str, Any]:
    """Return [ppo] settings as DeepRacer's `hyperparameters.json` has them."""
    named = {name: getattr(ppo, field) for name, field in PPO_NAMES.items()}
    if ppo.n_episodes is None:
        del named["num_episodes_between_training"]
    else:
        named["term_cond_max_episodes"] = ppo.n_iterations * ppo.n_episodes
    fixed = {"exploration_type": "categorical", "loss_type": "mean squared error", "stack_size": 1}
    return named | fixed


def _number(value: Any) -> Any:
    """Read a number that may be written as a text, as older files have it; others stay as is."""
    if isinstance(value, str) and len(value) < 40:
        for kind in (int, float):
            with suppress(ValueError):
                return kind(value)
    return value


def read_model_metadata(path: Path) -> dict[str, Any]:
    """Return the [env] settings that a `model_metadata.json` stands for: actions and sensors.

    Raises:
        CardError: the file cannot be read, asks for actions or sensors that the racer lacks, or for
            SAC.
    """
    data = _read_object(path)
    space = data.get("action_space")
    if not isinstance(space, dict):
        return {"actions": _actions(path, space), "sensors": _sensors(path, data)}
    if data.get("training_algorithm") == "sac":
        raise CardError(
            f"{path}: expected training_algorithm clipped_ppo, found sac: there is no SAC; with "
            "clipped_ppo the same ranges are trained in by PPO"
        )
    return {"actions": _ranges(path, space), "sensors": _sensors(path, data)}


def unread_metadata(path: Path, conv: Any) -> str | None:
    """Return what of a `model_metadata.json` is not taken over, and why; None where all is.

    Args:
        path: of a file that `read_model_metadata` has read.
        conv: the card's `net.conv`, which says the network: no word where the file says the same.
    """
    data, parts = _read_object(path), []
    for name in sorted(data.keys() - METADATA):
        what, why = f"{name:.60} = {data[name]!s:.60}", "it has no counterpart"
        if name == "training_algorithm":
            if data[name] == "clipped_ppo":
                continue
            why = "policies are trained with clipped PPO"
        elif name == "neural_network":
            names = NETWORKS.get(str(data[name]))
            wanted = names and names[_sensors(path, data).startswith("stereo")]
            if wanted == conv:
                continue
            why = f"the network is net.conv, {conv!s:.60}"
            why += f"; that one is net.conv = '{wanted}'" if wanted else ""
        parts.append(f"{what} ({why})")
    return f"{path}: not read: {'; '.join(parts)}" if parts else None


def model_metadata(actions: Actions, sensors: str, deep: bool) -> dict[str, Any]:
    """Return a racing task's actions (degrees, m/s) and sensors as a `model_metadata.json`."""
    camera, _, lidar = sensors.partition("+")
    names = {"camera": "FRONT_FACING_CAMERA", "stereo": "STEREO_CAMERAS"}
    return {
        **_action_space(actions),
        "sensor": [names[camera], *(["LIDAR"] if lidar else [])],
        "neural_network": "DEEP_CONVOLUTIONAL_NETWORK" + ("" if deep else "_SHALLOW"),
        "training_algorithm": "clipped_ppo",
        "version": "4",
    }


def _action_space(actions: Actions) -> dict[str, Any]:
    """Return the keys of a `model_metadata.json` that say what can be chosen."""
    if isinstance(actions, ActionRanges):
        ranges = {
            name: {"high": float(high), "low": float(low)}
            for name, (low, high) in actions.model_dump().items()
        }
        return {"action_space": ranges, "action_space_type": "continuous"}
    listed = [
        {"steering_angle": float(angle), "speed": float(speed), "index": i}
        for i, (angle, speed) in enumerate(actions)
    ]
    return {"action_space": listed, "action_space_type": "discrete"}


def _read_object(path: Path) -> dict[str, Any]:
    with reported_as(CardError):
        data = read_json(path)
    if not isinstance(data, dict):
        raise CardError(f"{path}: expected a JSON object, found {type(data).__name__}")
    return data


def _ranges(path: Path, space: dict[str, Any]) -> dict[str, list[float]]:
    try:
        return {
            name: [float(space[name][end]) for end in ("low", "high")]
            for name in ("steering_angle", "speed")
        }
    except (TypeError, KeyError, ValueError) as error:
        raise CardError(
            f"{path}: expected low and high of steering_angle and speed in action_space, found "
            f"{space!r:.100}"
        ) from error


def _actions(path: Path, space: Any) -> list[list[float]]:
    try:
        pairs = [[float(one["steering_angle"]), float(one["speed"])] for one in space]
    except (TypeError, KeyError, ValueError) as error:
        raise CardError(
            f"{path}: expected action_space to list steering_angle and speed, found {space!r:.60}"
        ) from error
    if not pairs or not all(isfinite(number) for pair in pairs for number in pair):
        raise CardError(
            f"{path}: expected at least one action of finite numbers, found {pairs!r:.60}"
        )
    return pairs


def _sensors(path: Path, data: dict[str, Any]) -> str:
    named = data.get("sensor", ["observation"])
    wanted = frozenset(map(str, named if isinstance(named, list) else [named]))
    if wanted not in SENSOR_NAMES:
        raise CardError(
            f"{path}: expected one of the cameras {', '.join(CAMERA_NAMES)}, with or without "
            f"LIDAR; found {', '.join(sorted(wanted)):.100}"
        )
    return SENSOR_NAMES[wanted]
