"""DeepRacer's own files of settings, as settings of a card, and back."""

from collections.abc import Sequence
from contextlib import suppress
from math import isfinite
from pathlib import Path
from typing import Any

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

OTHER_NAMES = {
    "e_greedy_value", "epsilon_steps", "exploration_type", "loss_type", "sac_alpha", "stack_size",
    "term_cond_avg_score", "term_cond_max_episodes",
}  # fmt: skip
"""Those about exploration, stacked images and the end of training; they are left out."""


def read_hyperparameters(path: Path) -> dict[str, Any]:
    """Return the [ppo] settings that a `hyperparameters.json` stands for.

    Raises:
        CardError: the file cannot be read, or has a key that is not DeepRacer's.
    """
    data = _read_object(path)
    unknown = sorted(data.keys() - PPO_NAMES.keys() - OTHER_NAMES)
    if unknown:
        known = ", ".join(sorted({*PPO_NAMES, *OTHER_NAMES}))
        raise CardError(f"{path}: unknown key '{unknown[0]:.60}'; DeepRacer's are {known}")
    return {field: _number(data[name]) for name, field in PPO_NAMES.items() if name in data}


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
        CardError: the file cannot be read, or asks for actions or sensors that the racer lacks.
    """
    data = _read_object(path)
    return {"actions": _actions(path, data.get("action_space")), "sensors": _sensors(path, data)}


def model_metadata(actions: Sequence[Sequence[float]], sensors: str, deep: bool) -> dict[str, Any]:
    """Return a racing task's actions (degrees, m/s) and sensors as a `model_metadata.json`."""
    camera, _, lidar = sensors.partition("+")
    names = {"camera": "FRONT_FACING_CAMERA", "stereo": "STEREO_CAMERAS"}
    return {
        "action_space": [
            {"steering_angle": float(angle), "speed": float(speed), "index": i}
            for i, (angle, speed) in enumerate(actions)
        ],
        "action_space_type": "discrete",
        "sensor": [names[camera], *(["LIDAR"] if lidar else [])],
        "neural_network": "DEEP_CONVOLUTIONAL_NETWORK" + ("" if deep else "_SHALLOW"),
        "training_algorithm": "clipped_ppo",
        "version": "4",
    }


def _read_object(path: Path) -> dict[str, Any]:
    with reported_as(CardError):
        data = read_json(path)
    if not isinstance(data, dict):
        raise CardError(f"{path}: expected a JSON object, found {type(data).__name__}")
    return data


def _actions(path: Path, space: Any) -> list[list[float]]:
    if isinstance(space, dict):
        raise CardError(
            f"{path}: expected a list of actions, found a continuous action space; the racer's "
            "policies choose among actions: list some, such as -30, -15, 0, 15, 30 degrees"
        )
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
