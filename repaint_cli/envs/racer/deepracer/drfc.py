"""Settings of DeepRacer-for-Cloud, a `run.env`, as settings of a card.

Names and defaults are those of its scripts, which hand them to the simulator.
"""

import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from string import Template
from typing import Any

from repaint_cli.errors import CardError, reported_as
from repaint_cli.files.limits import read_text

LIGHT, COLOURS = 0.3, 0.1
"""What DR_ENABLE_DOMAIN_RANDOMIZATION stands for; DeepRacer draws any light and any colour."""
RACE_TYPES = {
    "TIME_TRIAL": "time trial", "OBJECT_AVOIDANCE": "object avoidance",
    "HEAD_TO_BOT": "races among bots",
}  # fmt: skip
"""What DR_RACE_TYPE may be, and what it is called here."""


@dataclass
class DrfcSettings:
    """What a `run.env` says."""

    world: str
    """The track's name."""
    race_type: str
    """As `RACE_TYPES` calls it."""
    model: str
    """The name of what is trained."""
    card: dict[str, Any] = field(default_factory=dict)
    """Settings of a card, by `section.key`."""
    unread: dict[str, str] = field(default_factory=dict)
    """By name and value, why a setting has no counterpart."""


def _flag(text: str) -> bool:
    if text.lower() not in ("true", "false", "1", "0", "yes", "no"):
        raise ValueError("expected True or False")
    return text.lower() in ("true", "1", "yes")


def _places(text: str) -> list[list[float]]:
    pairs = [place.split(",") for place in text.split(";") if place.strip()]
    return [[float(share), int(lane)] for share, lane in pairs]


def _best(text: str) -> str:
    return {"progress": "progress", "reward": "return"}[text.lower()]


Reader = Callable[[str], Any]
COMMON: dict[str, tuple[str, Reader, str]] = {
    "DR_TRAIN_START_POSITION_OFFSET": ("env.start_offset", lambda text: float(text) % 1.0, ""),
    "DR_TRAIN_ROUND_ROBIN_ADVANCE_DIST": ("env.start_spacing", float, ""),
    "DR_TRAIN_ROUND_ROBIN_ADVANCE_DISTANCE": ("env.start_spacing", float, ""),
    "DR_TRAIN_MIN_EVAL_TRIALS": ("eval.episodes", int, ""),
    "DR_TRAIN_MAX_STEPS_PER_ITERATION": ("ppo.max_steps", int, ""),
    "DR_TRAIN_BEST_MODEL_METRIC": ("eval.best", _best, ""),
    "DR_EVAL_NUMBER_OF_TRIALS": ("eval.laps", int, ""),
    "DR_EVAL_MAX_RESETS": ("eval.max_resets", int, ""),
    "DR_EVAL_OFF_TRACK_PENALTY": ("eval.off_track_penalty", float, ""),
    "DR_EVAL_COLLISION_PENALTY": ("eval.crash_penalty", float, ""),
    "DR_EVAL_RESET_BEHIND_DIST": ("eval.reset_behind", float, ""),
}
"""Settings of every race type, and what they are here; they stay ours where absent."""
BOXES: dict[str, tuple[str, Reader, str]] = {
    "DR_OA_NUMBER_OF_OBSTACLES": ("env.n_boxes", int, "0"),
    "DR_OA_MIN_DISTANCE_BETWEEN_OBSTACLES": ("env.object_gap", float, "2.0"),
    "DR_OA_RANDOMIZE_OBSTACLE_LOCATIONS": ("env.random_objects", _flag, "False"),
    "DR_OA_OBJECT_POSITIONS": ("env.object_places", _places, ""),
}
"""Those of object avoidance, with their defaults."""
BOTS: dict[str, tuple[str, Reader, str]] = {
    "DR_H2B_NUMBER_OF_BOT_CARS": ("env.n_bots", int, "0"),
    "DR_H2B_MIN_DISTANCE_BETWEEN_BOT_CARS": ("env.object_gap", float, "2.0"),
    "DR_H2B_RANDOMIZE_BOT_CAR_LOCATIONS": ("env.random_objects", _flag, "False"),
    "DR_H2B_BOT_CAR_SPEED": ("env.bot_speed", float, "0.2"),
    "DR_H2B_IS_LANE_CHANGE": ("env.bot_lane_changes", _flag, "False"),
    "DR_H2B_LANE_CHANGE_DISTANCE": ("env.bot_change_length", float, "1.0"),
}
"""Those of races among bots, with their defaults."""
WAITS = ("DR_H2B_LOWER_LANE_CHANGE_TIME", "DR_H2B_UPPER_LANE_CHANGE_TIME")
READ = {
    *COMMON, *BOXES, *BOTS, *WAITS, "DR_WORLD_NAME", "DR_RACE_TYPE", "DR_OA_IS_OBSTACLE_BOT_CAR",
    "DR_TRAIN_CHANGE_START_POSITION", "DR_CHANGE_START_POSITION", "DR_TRAIN_REVERSE_DIRECTION",
    "DR_TRAIN_ALTERNATE_DRIVING_DIRECTION", "DR_ENABLE_DOMAIN_RANDOMIZATION",
    "DR_EVAL_IS_CONTINUOUS", "DR_LOCAL_S3_MODEL_PREFIX",
}  # fmt: skip
REASONS = {
    "DR_LOCAL_S3_PRETRAINED": "a training begins from a teacher: repaint transfer --teacher NAME",
    "DR_EVAL_OPP_": "there are no races against another model",
    "DR_EVAL_SAVE_MP4": "repaint eval --render-offscreen films",
    "DR_EVAL_CHECKPOINT": "repaint eval plays a run's last policy, its teacher is the best one",
    "DR_EVAL_REVERSE_DIRECTION": "env.direction is for training and evaluation",
    "DR_EVAL_RTF": "the simulator is as fast as it can be",
    "DR_TRAIN_RTF": "the simulator is as fast as it can be",
    "DR_TRAIN_MULTI_CONFIG": "one run has one card; env.track takes several tracks",
    "DR_OA_OBSTACLE_TYPE": "boxes look alike",
    "DR_H2B_BOT_CAR_PENALTY": "after a crash that is not the car's fault bots stand for 2 s",
    "DR_LOCAL_S3_": "there is no store but local files",
    "DR_UPLOAD_": "there is no store but local files",
    "DR_AWS_": "it runs on this machine alone",
    "DR_CLOUD": "it runs on this machine alone",
    "DR_RUN_ID": "runs have folders of their own",
    "DR_": "it changes nothing that is simulated",
}
"""Why a setting has no counterpart, by how its name begins; the first that fits."""

OUTRANKED: dict[str, tuple[str, bool | None]] = {
    "DR_OA_NUMBER_OF_OBSTACLES": ("DR_OA_OBJECT_POSITIONS", None),
    "DR_TRAIN_ROUND_ROBIN_ADVANCE_DIST": ("DR_TRAIN_CHANGE_START_POSITION", False),
    "DR_TRAIN_REVERSE_DIRECTION": ("DR_TRAIN_ALTERNATE_DRIVING_DIRECTION", True),
    "DR_EVAL_MAX_RESETS": ("DR_EVAL_IS_CONTINUOUS", False),
}
"""By which other setting one has no effect, at which of its values; None is any."""


def read_run_env(path: Path) -> DrfcSettings:
    """Read a `run.env`.

    Raises:
        CardError: it cannot be read, has no track or another race type, or a value that is none.
    """
    given = {name: value for name, value in _variables(path).items() if value}
    if not given.get("DR_WORLD_NAME"):
        raise CardError(f"{path}: expected DR_WORLD_NAME, the track; found none")
    kind = given.get("DR_RACE_TYPE", "TIME_TRIAL")
    if kind not in RACE_TYPES:
        raise CardError(
            f"{path}: expected DR_RACE_TYPE to be one of {', '.join(RACE_TYPES)}; found "
            f"'{kind:.60}'"
        )
    model = given.get("DR_LOCAL_S3_MODEL_PREFIX", "").rstrip("/").rpartition("/")[2] or "my-task"
    settings = DrfcSettings(given["DR_WORLD_NAME"], RACE_TYPES[kind], model)
    own = {"OBJECT_AVOIDANCE": BOXES, "HEAD_TO_BOT": BOTS}.get(kind, {})
    for name, (key, read, default) in (COMMON | own).items():
        if text := given.get(name, default):
            settings.card[key] = _value(path, name, text, read)
    if kind == "OBJECT_AVOIDANCE":
        _add_boxes(path, given, settings.card)
    if kind == "HEAD_TO_BOT":
        waits = zip(WAITS, ("3.0", "5.0"), strict=True)
        times = [_value(path, name, given.get(name, usual), float) for name, usual in waits]
        settings.card["env.bot_waits"] = times
    _add_ways(path, given, settings.card)
    for name, value in given.items():
        if why := _why_unread(name, kind) or _outranked(path, given, name):
            settings.unread[f"{name} = {value}"] = why
    return settings


def _add_boxes(path: Path, given: Mapping[str, str], card: dict[str, Any]) -> None:
    """Count given places, which outrank the number, and turn boxes into cars that stand."""
    if card.get("env.object_places"):
        card["env.n_boxes"] = len(card["env.object_places"])
    if _value(path, "DR_OA_IS_OBSTACLE_BOT_CAR", given.get("DR_OA_IS_OBSTACLE_BOT_CAR", "False"),
              _flag):  # fmt: skip
        card |= {"env.n_bots": card.pop("env.n_boxes"), "env.bot_speed": 0.0, "env.crash": "any"}


def _add_ways(path: Path, given: Mapping[str, str], card: dict[str, Any]) -> None:
    """Add where and which way training drives, what it looks like, and whether a race goes on."""

    def flag(*names: str, usual: bool = False) -> bool:
        texts = [(name, given[name]) for name in names if given.get(name)]
        return _value(path, *texts[0], _flag) if texts else usual

    if not flag("DR_TRAIN_CHANGE_START_POSITION", "DR_CHANGE_START_POSITION", usual=True):
        card["env.start_spacing"] = 0.0
    if flag("DR_TRAIN_ALTERNATE_DRIVING_DIRECTION"):
        card["env.direction"] = "alternate"
    elif flag("DR_TRAIN_REVERSE_DIRECTION"):
        card["env.direction"] = "reverse"
    if flag("DR_ENABLE_DOMAIN_RANDOMIZATION"):
        card |= {"env.random_light": LIGHT, "env.random_colours": COLOURS}
    if not flag("DR_EVAL_IS_CONTINUOUS", usual=True):
        card["eval.max_resets"] = 0


def _outranked(path: Path, given: Mapping[str, str], name: str) -> str | None:
    """Return which setting takes the place of another; None where none does."""
    other, value = OUTRANKED.get(name, ("", None))
    if other not in given or (
        value is not None and _value(path, other, given[other], _flag) != value
    ):
        return None
    return f"{other} = {given[other]} outranks it"


def _variables(path: Path) -> dict[str, str]:
    """Return the variables that a file of the shell sets, those that it refers to put in place."""
    with reported_as(CardError):
        text = read_text(path)
    variables: dict[str, str] = {}
    for number, line in enumerate(text.splitlines(), 1):
        try:
            words = [word for word in shlex.split(line, comments=True) if word != "export"]
        except ValueError as error:
            raise CardError(f"{path}:{number}: expected NAME=value, found {line!r:.80}") from error
        for word in words:
            name, equals, value = word.partition("=")
            if not equals or not name.isidentifier():
                raise CardError(f"{path}:{number}: expected NAME=value, found {line!r:.80}")
            variables[name] = Template(value).safe_substitute(variables)
    return variables


def _value(path: Path, name: str, text: str, read: Reader) -> Any:
    try:
        return read(text)
    except (ValueError, KeyError) as error:
        raise CardError(f"{path}: {name} has a value that it cannot have, '{text:.60}'") from error


def _why_unread(name: str, kind: str) -> str | None:
    """Return why a setting of a race of some type has no counterpart; None where it has one."""
    for begin, other in (("DR_OA_", "OBJECT_AVOIDANCE"), ("DR_H2B_", "HEAD_TO_BOT")):
        if name.startswith(begin) and kind != other:
            return f"it is of the race type {other}"
    if name in READ:
        return None
    fits = (why for begin, why in REASONS.items() if name.startswith(begin))
    return next(fits, "it is not DeepRacer-for-Cloud's")
