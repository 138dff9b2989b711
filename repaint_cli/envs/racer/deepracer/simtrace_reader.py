"""Logs as DeepRacer writes them, read: the training episodes of a folder, or those of a file.

**T** steps.
"""

import re
from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby, islice
from pathlib import Path

import numpy as np

from repaint_cli.envs.racer.deepracer.simtrace_text import read_lines
from repaint_cli.envs.racer.deepracer.traces import Trace
from repaint_cli.errors import CheckpointError, reported_as
from repaint_cli.files.limits import read_rows

TRAINING = "training-simtrace"
"""The folder of the training episodes, a file per iteration."""

TRACE_COLUMNS = (
    "X", "Y", "yaw", "steer", "throttle", "action", "reward", "progress", "closest_waypoint",
    "obstacle_crash_counter",
)  # fmt: skip
"""The columns that a trace is made of; older logs have no crashes."""

MORE_COLUMNS = ("steps", "tstamp", "track_len")
"""What is read besides."""

UNPAID = ("prepare", "pause", "park")
"""Statuses of steps in which DeepRacer calls no reward function, and logs a reward of 0."""

MOST_EPISODES = 10_000
"""In a file; each is many arrays."""


_FILE_NAME = re.compile(r"([0-9]{1,9})-iteration\.csv")


def training_files(folder: Path) -> list[tuple[int, Path]]:
    """Return the files of training episodes in a log folder with their iterations, k from 1."""
    paths = folder.glob(f"{TRAINING}/*-iteration.csv")
    named = [(_FILE_NAME.fullmatch(path.name), path) for path in paths]
    files = [(int(name[1]) + 1, path) for name, path in named if name]
    return sorted(files, key=lambda file: file[0])


@dataclass(frozen=True)
class LoggedEpisode:
    """An episode of a log, with what a trace leaves out. Arrays are (T,)."""

    number: int
    """What the log calls it."""
    trace: Trace
    """The car's episode."""
    steps: np.ndarray
    """Of the episode, from 1; an evaluation that drives lap after lap counts on."""
    seconds: np.ndarray
    """Of the simulation, s."""
    unpaid: np.ndarray
    """Whether the status is one of `UNPAID`."""
    track_length: float
    """Of the centre line, m."""


def read_training(folder: Path) -> Iterator[tuple[int, list[LoggedEpisode]]]:
    """Yield the training episodes of a log folder by iteration, k from 1, in order.

    Raises:
        CheckpointError: a file cannot be read or is damaged.
    """
    for k, path in training_files(folder):
        yield k, read_episodes(path)


def read_episodes(path: Path) -> list[LoggedEpisode]:
    """Read a file of ours or of DeepRacer's, a simtrace (.csv) or a text.

    Raises:
        CheckpointError: the file cannot be read, or is no log of episodes.
    """
    needed = ("episode", "episode_status", *MORE_COLUMNS, *TRACE_COLUMNS[:-1])
    rows = read_rows(path, needed) if path.suffix.lower() == ".csv" else read_lines(path)
    try:
        with reported_as(CheckpointError):
            parts = groupby(rows, key=_Episodes())
            episodes = [_episode(part) for _, part in islice(parts, MOST_EPISODES + 1)]
    except ValueError as error:
        raise CheckpointError(f"{path} is damaged: {error!s:.200}") from error
    if len(episodes) > MOST_EPISODES:
        raise CheckpointError(f"{path}: expected at most {MOST_EPISODES:,} episodes, found more")
    return episodes


class _Episodes:
    """Counts episodes: one begins with another number, or where the steps begin anew."""

    def __init__(self) -> None:
        self._count, self._number, self._steps = 0, "", 0.0

    def __call__(self, row: dict[str, str]) -> int:
        """Return which episode a row is of."""
        number, steps = row["episode"], float(row["steps"])
        self._count += number != self._number or steps <= self._steps
        self._number, self._steps = number, steps
        return self._count


def _episode(rows: Iterator[dict[str, str]]) -> LoggedEpisode:
    """Return an episode; a log is long, so nothing but numbers is kept meanwhile."""
    numbers, status, number = array("d"), "", 0.0
    for row in rows:
        numbers.extend(_number(row, name) for name in (*TRACE_COLUMNS, *MORE_COLUMNS))
        status, number = row["episode_status"], float(row["episode"])
        numbers.append(row.get("all_wheels_on_track") == "True")
        numbers.append(status in UNPAID)
    names = (*TRACE_COLUMNS, *MORE_COLUMNS, "on", "unpaid")
    table = np.frombuffer(numbers).reshape(-1, len(names))
    if not -(2**53) < min(table.min(), number) <= max(table.max(), number) < 2**53:  # nan, too
        raise ValueError("expected numbers within 2^53")
    whole = dict(zip(names, table.T, strict=True))
    trace = Trace(
        x=whole["X"],
        y=whole["Y"],
        yaw=whole["yaw"],
        steer=whole["steer"],
        throttle=whole["throttle"],
        action=whole["action"].astype(int),
        reward=whole["reward"],
        all_wheels_on_track=whole["on"] == 1,
        progress=whole["progress"],
        closest_waypoint=whole["closest_waypoint"].astype(int),
        crashes=whole["obstacle_crash_counter"].astype(int),
        status=status,
    )
    return LoggedEpisode(
        number=int(number),
        trace=trace,
        steps=whole["steps"],
        seconds=whole["tstamp"],
        unpaid=whole["unpaid"] == 1,
        track_length=float(whole["track_len"][-1]),
    )


def _number(row: dict[str, str], name: str) -> float:
    """Return a value of a row; -1 for an action that is no number, as a continuous one is none.

    Raises:
        ValueError: another value is no number.
    """
    try:
        return float(row.get(name) or 0)
    except ValueError:
        if name == "action":
            return -1.0
        raise
