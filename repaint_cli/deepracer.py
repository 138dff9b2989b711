"""What DeepRacer's own files say, as settings of a card."""

import json
from math import isfinite
from pathlib import Path
from typing import Any

from repaint_cli.errors import CardError

SENSORS = {
    frozenset({"observation"}): "camera",
    frozenset({"FRONT_FACING_CAMERA"}): "camera",
    frozenset({"LEFT_CAMERA"}): "camera",
    frozenset({"STEREO_CAMERAS"}): "stereo",
    frozenset({"STEREO_CAMERAS", "LIDAR"}): "stereo+lidar",
}
"""What a car may carry, and what we call it."""


def read_model_metadata(path: Path) -> dict[str, Any]:
    """Return the [env] settings that a `model_metadata.json` stands for: actions and sensors.

    Raises:
        CardError: it cannot be read, or asks for what the racer has not.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise CardError(f"cannot read {path}: {error}") from error
    if not isinstance(data, dict):
        raise CardError(f"{path}: expected a JSON object, found {type(data).__name__}")
    return {"actions": _actions(path, data.get("action_space")), "sensors": _sensors(path, data)}


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
        raise CardError(f"{path}: expected at least one action of finite numbers, found {pairs}")
    return pairs


def _sensors(path: Path, data: dict[str, Any]) -> str:
    named = data.get("sensor", ["observation"])
    wanted = frozenset(named) if isinstance(named, list) else frozenset([str(named)])
    if wanted not in SENSORS:
        known = "; ".join(" and ".join(sorted(each)) for each in SENSORS)
        raise CardError(f"{path}: expected the sensors {known}; found {', '.join(sorted(wanted))}")
    return SENSORS[wanted]
