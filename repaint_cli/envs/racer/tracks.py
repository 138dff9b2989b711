"""The tracks of a card: one or several, their names, and where their episodes start.

Reading a card needs no arrays, and there are none here.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

Names = str | tuple[str, ...]
"""One track or several: shipped ones by name, or paths of files of waypoints."""

Options = dict[str, list[Any]]
"""Start options of `reset`, a value an episode."""

MOST_TRACKS = 64
"""The ground of each is a picture that stays in memory."""


def checked_names(names: Any) -> Names:
    """Return `env.track` with whole paths, a list of one as the one.

    Raises:
        ValueError: it is neither a name nor a list of 1 to 64 names that differ.
    """
    each = names if isinstance(names, list | tuple) else [names]
    if not all(isinstance(name, str) for name in each):
        raise ValueError("expected the name of a track or a list of names")
    if not 1 <= len(each) <= MOST_TRACKS:
        raise ValueError(f"expected 1 to {MOST_TRACKS} tracks in a list")
    whole = [str(Path(name).absolute()) if is_file(name) else name for name in each]
    for name in whole:
        if whole.count(name) > 1:
            raise ValueError(
                f"expected each track once, as all are driven alike; '{name}' is there twice"
            )
    return whole[0] if len(whole) == 1 else tuple(whole)


def is_file(name: Any) -> bool:
    """Return whether a track's name is the path of a user's file."""
    return isinstance(name, str) and name.endswith(".npy")


def beside(folder: Path, names: Any) -> Any:
    """Return `env.track`, its files in the folder of the card that names them."""
    if isinstance(names, list | tuple):
        return [beside(folder, name) for name in names]
    return str(folder / names) if is_file(names) else names


def labels_of(names: Sequence[str]) -> list[str]:
    """Return short names of tracks for people, which differ."""
    paths = [Path(name) if is_file(name) else Path(f"{name}.npy") for name in names]
    labels = [path.stem for path in paths]
    if len(set(labels)) < len(labels):
        labels = [f"{path.parent.name}/{path.stem}".lstrip("/") for path in paths]
    return labels if len(set(labels)) == len(labels) else list(names)


def files_of(names: Sequence[str]) -> dict[str, Path]:
    """Return the user's files among tracks, by setting."""
    if len(names) == 1:
        return {"track": Path(names[0])} if is_file(names[0]) else {}
    labels = labels_of(names)
    return {
        f"track {label}": Path(name)
        for label, name in zip(labels, names, strict=True)
        if is_file(name)
    }


class Starts(NamedTuple):
    """Where episodes start. Episode e, counted through all iterations, drives track e mod n."""

    n_tracks: int
    """n."""
    offset: float
    """Where the first training episode on each track starts, share of the lap."""
    spacing: float
    """How much farther on each later one starts, share of the lap."""

    def evaluation(self, n_envs: int) -> tuple[Options, list[bool]]:
        """Return the start options of N evaluated episodes, spread evenly over each track.

        And which go the other way where both ways are driven: every other one on each track.
        """
        turns = self._turns(0, n_envs)
        each = -(-n_envs // self.n_tracks)
        places = [turn / each for turn, _ in turns]
        return self._options(places, turns), [turn % 2 == 1 for turn, _ in turns]

    def training(self, n_envs: int, iteration: int) -> tuple[Options, list[bool]]:
        """Return those of the N training episodes of an iteration, which go on from the last one's.

        The other way goes every other one on each track, and from each place the other way the
        next time round.
        """
        turns = self._turns((iteration - 1) * n_envs, n_envs)
        along = [turn * self.spacing for turn, _ in turns]
        places = [(self.offset + place) % 1 for place in along]
        other = [(turn + int(a)) % 2 == 1 for (turn, _), a in zip(turns, along, strict=True)]
        return self._options(places, turns), other

    def _turns(self, first: int, n_envs: int) -> list[tuple[int, int]]:
        """Return which episode of its track, from 0, and which track each episode is."""
        return [divmod(first + n, self.n_tracks) for n in range(n_envs)]

    def _options(self, places: list[float], turns: list[tuple[int, int]]) -> Options:
        if self.n_tracks == 1:
            return {"lap_fraction": places}
        return {"lap_fraction": places, "track": [track for _, track in turns]}
