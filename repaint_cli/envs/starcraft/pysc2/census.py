"""What happened between two observations, told by which units are there.

Every unit has a tag for life. The game lists all of ours, so a new tag is a unit that came to be,
and one that is missing has died. What dies of the enemy's the game says itself.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from repaint_cli.envs.starcraft.rts.constants import ENEMY, SELF

FINISHED = 100
"""Of a building's progress, %."""


class Happened(NamedTuple):
    """What happened in a step, counted."""

    scvs_trained: int = 0
    barracks_built: int = 0
    marines_built: int = 0
    marines_died: int = 0
    zerglings_killed: int = 0


class Census:
    """Knows which units there were in an episode."""

    def __init__(self, observation: Any) -> None:
        """Begin with what is there at the beginning, which nobody built."""
        self._ever = {kind: self._own(observation, kind) for kind in ("SCV", "Barracks", "Marine")}
        self._marines = self._ever["Marine"]
        self._zerglings = _tags(observation, "Zergling", ENEMY)

    def count(self, observation: Any) -> Happened:
        """Return what happened since the last observation."""
        came = {kind: self._own(observation, kind) - ever for kind, ever in self._ever.items()}
        for kind, tags in came.items():
            self._ever[kind] |= tags
        marines = self._own(observation, "Marine")
        died = len(self._marines - marines)
        self._marines = marines
        killed = self._zerglings & set(_raw(observation).event.dead_units)
        self._zerglings = (self._zerglings - killed) | _tags(observation, "Zergling", ENEMY)
        return Happened(
            len(came["SCV"]), len(came["Barracks"]), len(came["Marine"]), died, len(killed)
        )

    @staticmethod
    def _own(observation: Any, kind: str) -> set[int]:
        return _tags(observation, kind, SELF)


def selected(observation: Any) -> set[int]:
    """Return the tags of our selected units."""
    units = observation["raw_units"]
    if not len(units):
        return set()
    rows = (units[:, _column("alliance")] == SELF) & (units[:, _column("is_selected")] > 0)
    return set(np.asarray(units)[rows, _column("tag")].tolist())


def camera(observation: Any) -> Any:
    """Return the point in the middle of the screen, units."""
    return _raw(observation).player.camera


def _raw(observation: Any) -> Any:
    return observation["_response_observation"]().observation.raw_data


def _tags(observation: Any, kind: str, alliance: int) -> set[int]:
    """Return the tags of finished units of a kind."""
    from pysc2.lib import units

    there = np.asarray(observation["raw_units"])
    if not len(there):
        return set()
    race = units.Zerg if alliance == ENEMY else units.Terran
    rows = (
        (there[:, _column("unit_type")] == race[kind])
        & (there[:, _column("alliance")] == alliance)
        & (there[:, _column("build_progress")] >= FINISHED)
    )
    return set(there[rows, _column("tag")].tolist())


@lru_cache
def _column(name: str) -> int:
    from pysc2.lib import features

    return int(features.FeatureUnit[name])
