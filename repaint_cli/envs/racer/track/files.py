"""Tracks by name, or from a file of waypoints."""

import os
import re
from math import prod
from pathlib import Path

import numpy as np

from repaint_cli.envs.racer.track.track import Track
from repaint_cli.errors import CardError, NotFound
from repaint_cli.files.limits import read_bytes
from repaint_cli.paths import shipped

_ARRAY = re.compile(
    rb"\x93NUMPY(?:\x01\0..|[\x02\x03]\0....)"
    rb"\{'descr': '(?P<dtype>[<>|][fiuc](?P<bytes>\d{1,2}))', "
    rb"'fortran_order': (?P<columns>True|False), 'shape': \((?P<shape>[\d, ]{0,60})\), \} *\n",
    re.DOTALL,
)
"""What numpy.save writes before an array of numbers: read so, nothing has to be evaluated."""


def load_track(name: str) -> Track:
    """Read a shipped track by name, or a file of waypoints (N, 6) by its path (`my-track.npy`).

    Raises:
        NotFound: there is no such track.
        CardError: the file holds no track.
    """
    path = Path(name)
    if path.suffix != ".npy":
        folder = shipped("tasks") / "racer" / "tracks"
        known = {path.stem: path for path in sorted(folder.glob("*.npy"))}
        if name not in known:
            there = ", ".join(known)
            raise NotFound(
                f"unknown track '{name:.200}'; there are {there}, and files that end in .npy"
            )
        path = known[name]
    if not os.path.exists(path):  # which takes any name
        raise NotFound(f"expected a file of waypoints at '{name:.500}', found none")
    data = read_bytes(path, CardError)
    head = _ARRAY.match(data)
    shape = [int(size) for size in re.findall(rb"\d+", head["shape"])] if head else []
    if head is None or len(data) - head.end() != prod(shape) * int(head["bytes"]):
        raise CardError(
            f"expected an array (N, 6) of waypoints, as numpy.save writes it, found none in {path}"
        )
    dtype, by_columns = head["dtype"].decode(), head["columns"] == b"True"
    try:
        rows = np.ndarray(shape, dtype, data, head.end(), order="F" if by_columns else "C")
        return Track.from_waypoints(rows, path.stem)
    except (ValueError, TypeError) as error:
        raise CardError(f"{path}: {error}") from error
