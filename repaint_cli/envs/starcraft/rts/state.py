"""The state of N games: a record each, all arrays of it named here.

`State.arrays` is one structured array, (N,), so that a kernel takes all of a game as one argument,
a copy of a game is a copy of its bytes, and every field is an array with the games first:
`state.marine_x` is (N, 200). Times are loops since the game began; lengths are the game's units.
Places in arrays of units are free where `scv_state`, `depot_done`, `barracks_done`, `marine_hp` or
`zergling_hp` is 0.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.starcraft.rts.constants import (
    COMMANDS,
    MAP_SIZE,
    MAX_BARRACKS,
    MAX_DEPOTS,
    MAX_MARINES,
    MAX_PATCHES,
    MAX_SCVS,
    MAX_ZERGLINGS,
    TERMS,
)

ABSENT, IDLE, TO_PATCH, WAITING, MINING, RETURNING, TO_CENTRE, TO_SITE, CONSTRUCTING = range(9)
"""What an SCV does. RETURNING: it has dug and stands before it turns home."""
NOTHING, ONE_SCV, THE_CENTRE, ONE_BARRACKS, ONE_DEPOT, MARINES = range(6)
"""What is selected."""
NO_ORDER, ATTACK_MOVE = range(2)
"""What a marine was told."""

_GAME = (
    ("rng", "u8"),  # counter of splitmix64
    ("loop", "i4"),
    ("minerals", "i4"),  # in the bank
    ("food_used", "i2"),  # units and what is queued
    ("food_cap", "i2"),
    ("food_workers", "i2"),  # SCVs alive
    ("army_count", "i2"),  # marines alive
    ("terminated", "u1"),
    ("truncated", "u1"),
)
_SCVS = (
    ("scv_state", "u1"),
    ("scv_x", "f8"), ("scv_y", "f8"),  # where it is now
    ("scv_x0", "f8"), ("scv_y0", "f8"), ("scv_x1", "f8"), ("scv_y1", "f8"),  # its walk
    ("scv_t0", "f8"), ("scv_t1", "f8"),  # when it began, and when it, or what it does, ends
    ("scv_patch", "i2"),  # −1: none
    ("scv_carry", "u1"),  # minerals
    ("scv_site_kind", "u1"),  # the command, BUILD_DEPOT or BUILD_BARRACKS
    ("scv_site_x", "f8"), ("scv_site_y", "f8"),
)  # fmt: skip
_PATCHES = (
    ("patch_left", "i2"),  # minerals
    ("patch_free", "f8"),  # when the next SCV may dig
    ("patch_assigned", "u1"),  # SCVs
)
_DEPOTS = (
    ("depot_x", "f8"), ("depot_y", "f8"), ("depot_begun", "i4"), ("depot_done", "i4")
)  # fmt: skip
_BARRACKS = (
    ("barracks_x", "f8"), ("barracks_y", "f8"), ("barracks_begun", "i4"), ("barracks_done", "i4"),
    ("barracks_queue", "u1"), ("barracks_head", "i4"),  # when the marine in training is done
)  # fmt: skip
_CENTRE = (("centre_queue", "u1"), ("centre_head", "i4"))
_MARINES = (
    ("marine_x", "f8"), ("marine_y", "f8"), ("marine_hp", "f8"),
    ("marine_cooldown", "f8"),  # loops until it may shoot
    ("marine_order", "u1"),
    ("marine_goal_x", "f8"), ("marine_goal_y", "f8"), ("marine_goal_reach", "f8"),
    ("marine_target", "i2"),  # a zergling; −1: none
    ("marine_selected", "u1"),
)  # fmt: skip
_ZERGLINGS = (
    ("zergling_x", "f8"), ("zergling_y", "f8"), ("zergling_hp", "f8"),
    ("zergling_home_x", "f8"), ("zergling_home_y", "f8"),
    ("zergling_cooldown", "f8"),
    ("zergling_swing", "f8"),  # loops until its blow tells; −1: none is under way
    ("zergling_target", "i2"),  # a marine; −1: none
)  # fmt: skip
_SELECTION = (("selected_kind", "u1"), ("selected_index", "i2"))
_LAST = (
    ("last_command", "i2"),  # −1: none yet
    ("last_x", "i2"), ("last_y", "i2"),  # its pixel
    ("last_refused", "u1"),  # whether it was unavailable
)  # fmt: skip
STATS = (
    "marines_built", "marines_died", "zerglings_killed", "scvs_trained", "depots_built",
    "barracks_built", "minerals_mined", "minerals_spent", "respawns", "placed_closer",
)  # fmt: skip
"""What is counted over a game; `placed_closer`: zerglings that found no place 5 units apart."""

GAME = np.dtype(
    [
        *_GAME,
        *((name, kind, (MAX_SCVS,)) for name, kind in _SCVS),
        *((name, kind, (MAX_PATCHES,)) for name, kind in _PATCHES),
        *((name, kind, (MAX_DEPOTS,)) for name, kind in _DEPOTS),
        *((name, kind, (MAX_BARRACKS,)) for name, kind in _BARRACKS),
        *_CENTRE,
        *((name, kind, (MAX_MARINES,)) for name, kind in _MARINES),
        *((name, kind, (MAX_ZERGLINGS,)) for name, kind in _ZERGLINGS),
        *_SELECTION,
        ("visibility", "u1", (MAP_SIZE, MAP_SIZE)),  # HIDDEN, SEEN, VISIBLE; [y, x], y upward
        ("available", "u1", (len(COMMANDS),)),
        ("phi", "f4", (len(TERMS),)),  # of the last step
        *_LAST,
        *((name, "i4") for name in STATS),
    ],
    align=True,
)
"""One game."""


class State:
    """The arrays of N games; each field of `GAME` is an attribute, (N, …), and a view."""

    def __init__(self, n: int) -> None:
        """Make N games of zeros, which `MiniRTS.reset` begins."""
        self.arrays: NDArray[np.void] = np.zeros(n, GAME)
        """All of it, (N,) of `GAME`."""

    def __getattr__(self, name: str) -> NDArray[Any]:
        """Return a field of all games, (N, …), a view."""
        if name not in (GAME.names or ()):
            raise AttributeError(f"a game has no array '{name}'")
        return self.arrays[name]

    def snapshot(self, rows: NDArray[np.int64]) -> NDArray[np.void]:
        """Return copies of some games, (K,) of `GAME`."""
        return bytes_of(self.arrays)[rows].view(GAME)[:, 0]

    def restore(self, rows: NDArray[np.int64], snapshot: NDArray[np.void]) -> None:
        """Put games (K,) back as they were when the snapshot was made."""
        bytes_of(self.arrays)[rows] = bytes_of(snapshot)


def bytes_of(games: NDArray[np.void]) -> NDArray[np.uint8]:
    """Return the bytes of games, (N, bytes), a view; those between fields are copied with them."""
    return np.ascontiguousarray(games).view(np.uint8).reshape(len(games), GAME.itemsize)
