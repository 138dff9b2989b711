"""Logs as DeepRacer writes them, read: the training episodes of a folder, or those of a file."""

import re
from array import array
from collections.abc import Iterator
from itertools import groupby, islice
from operator import itemgetter
from pathlib import Path

import numpy as np

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

MOST_EPISODES = 10_000
"""In a file; each is many arrays."""


_FILE_NAME = re.compile(r"([0-9]{1,9})-iteration\.csv")


def training_files(folder: Path) -> list[tuple[int, Path]]:
    """Return the files of training episodes in a log folder with their iterations, k from 1."""
    paths = folder.glob(f"{TRAINING}/*-iteration.csv")
    named = [(_FILE_NAME.fullmatch(path.name), path) for path in paths]
    files = [(int(name[1]) + 1, path) for name, path in named if name]
    return sorted(files, key=lambda file: file[0])


def read_training(folder: Path) -> Iterator[tuple[int, list[Trace]]]:
    """Yield the training episodes of a log folder by iteration, k from 1, in order.

    Raises:
        CheckpointError: a file cannot be read or is damaged.
    """
    for k, path in training_files(folder):
        yield k, read_simtrace(path)


def read_simtrace(path: Path) -> list[Trace]:
    """Read a file of ours or of DeepRacer's.

    Raises:
        CheckpointError: the file cannot be read, or is no log of episodes.
    """
    needed = ("episode", "episode_status", *TRACE_COLUMNS[:-1])
    episodes = groupby(read_rows(path, needed), key=itemgetter("episode"))
    try:
        with reported_as(CheckpointError):
            traces = [_trace(rows) for _, rows in islice(episodes, MOST_EPISODES + 1)]
    except ValueError as error:
        raise CheckpointError(f"{path} is damaged: {error!s:.200}") from error
    if len(traces) > MOST_EPISODES:
        raise CheckpointError(f"{path}: expected at most {MOST_EPISODES:,} episodes, found more")
    return traces


def _trace(rows: Iterator[dict[str, str]]) -> Trace:
    """Return the trace of an episode; a log is long, so nothing but numbers is kept meanwhile."""
    numbers, status = array("d"), ""
    for row in rows:
        numbers.extend(float(row.get(name) or 0) for name in TRACE_COLUMNS)
        numbers.append(row.get("all_wheels_on_track") == "True")
        status = row["episode_status"]
    table = np.frombuffer(numbers).reshape(-1, len(TRACE_COLUMNS) + 1)
    if not -(2**53) < table.min() <= table.max() < 2**53:  # nan is refused, too
        raise ValueError("expected numbers within 2^53")
    whole = dict(zip((*TRACE_COLUMNS, "on"), table.T, strict=True))
    return Trace(
        **{name.lower(): whole[name] for name in ("X", "Y", "yaw", "steer", "throttle")},
        action=whole["action"].astype(int),
        reward=whole["reward"],
        all_wheels_on_track=whole["on"] == 1,
        progress=whole["progress"],
        closest_waypoint=whole["closest_waypoint"].astype(int),
        crashes=whole["obstacle_crash_counter"].astype(int),
        status=status,
    )
