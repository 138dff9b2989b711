"""Tracks by name, or from a file of waypoints."""

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Literal

from repaint_cli.envs.racer.track.track import Track
from repaint_cli.errors import CardError, NotFound, reported_as
from repaint_cli.files.limits import read_bytes
from repaint_cli.files.npy import NotAnArray, read_npy
from repaint_cli.files.paths import shipped

Waypoints = Literal["file", "unique"]
"""How waypoints are numbered: as rows of the file, or without rows that repeat another."""


def shipped_tracks() -> dict[str, Path]:
    """Return the files of the shipped tracks by name."""
    folder = shipped("tasks") / "racer" / "tracks"
    return {path.stem: path for path in sorted(folder.glob("*.npy"))}


def load_tracks(names: Iterable[str], waypoints: Waypoints = "file") -> list[Track]:
    """Read several tracks; see `load_track`."""
    return [load_track(name, waypoints) for name in names]


def load_track(name: str, waypoints: Waypoints = "file") -> Track:
    """Read a shipped track by name, or a file of waypoints (N, 6) by its path (`my-track.npy`).

    Args:
        name: of the track, or its path.
        waypoints: how they are numbered.

    Raises:
        NotFound: there is no track of this name, or no such file.
        CardError: the file holds no array of waypoints, or the waypoints are no track.
    """
    path = Path(name)
    if path.suffix != ".npy":
        known = shipped_tracks()
        if name not in known:
            names = ", ".join(known)
            raise NotFound(
                f"unknown track '{name:.200}'; there are {names}, and files that end in .npy"
            )
        path = known[name]
    if not os.path.exists(path):  # which takes any name
        raise NotFound(f"expected a file of waypoints at '{name:.500}', found none")
    with reported_as(CardError):
        data = read_bytes(path)
    try:
        rows = read_npy(data, kinds="fiuc")
        return Track.from_waypoints(rows, path.stem, unique=waypoints == "unique")
    except NotAnArray as error:
        raise CardError(
            f"expected an array (N, 6) of waypoints, as numpy.save writes it, found none in {path}"
        ) from error
    except ValueError as error:
        raise CardError(f"{path}: {error}") from error
