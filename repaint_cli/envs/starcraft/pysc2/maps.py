"""The mini-games as maps of the game: files, cameras, and how long an episode may be."""

from dataclasses import dataclass, replace
from pathlib import Path

LOOPS_PER_MINUTE = 16 * 60
"""Of the game's own clock."""

SAFE_MINUTES = 14.0
"""Of a game that is restarted in its process. Where the mineral patch that the command centre
sends SCVs to is used up, which takes little longer, it is missing in all later episodes."""

RELEASE = "https://github.com/google-deepmind/pysc2/releases/tag/v1.2"
"""Where mini_games.zip is."""


@dataclass(frozen=True)
class RealMap:
    """A mini-game in the game."""

    file: Path | None
    """Of the map, relative to the game's folder Maps, or absolute; None where a user makes it."""
    camera_width: float
    """What the screen shows, in the game's units of length; it is a square."""
    loops: int
    """After which an episode is cut off."""
    has_base: bool = True
    """Whether there are a command centre and SCVs, which all mine at the beginning."""
    has_enemies: bool = False
    """Whether there are zerglings; the army takes commands only then."""
    begins_with_no_op: bool = False
    """Whether marines are selected at the beginning, which the screen shows one action later."""


MAPS = {
    "build-marines": RealMap(
        Path("mini_games/BuildMarines.SC2Map"), 24, round(SAFE_MINUTES * LOOPS_PER_MINUTE)
    ),
    "build-marines-fdz": RealMap(
        None, 62, round(SAFE_MINUTES * LOOPS_PER_MINUTE), has_enemies=True
    ),
    "find-and-defeat-zerglings": RealMap(
        Path("mini_games/FindAndDefeatZerglings.SC2Map"), 46, 3 * LOOPS_PER_MINUTE,
        has_base=False, has_enemies=True, begins_with_no_op=True,
    ),
}  # fmt: skip
"""By the names of `names.MAPS`."""


def real_map(
    name: str, minutes: float | None = None, file: Path | None = None, one_process: bool = True
) -> RealMap:
    """Return a mini-game with a user's settings.

    Args:
        name: one of `names.MAPS`.
        minutes: time limit of an episode, by the game's own clock; None is the longest.
        file: a user's map in place of the known one.
        one_process: whether a process plays more than one episode; see `SAFE_MINUTES`.
    """
    known = MAPS[name]
    limit = SAFE_MINUTES if one_process else 15.0
    longest = round(limit * LOOPS_PER_MINUTE) if known.has_base else known.loops
    loops = longest if minutes is None else min(round(minutes * LOOPS_PER_MINUTE), longest)
    return replace(known, loops=max(loops, 1), file=file or known.file)
