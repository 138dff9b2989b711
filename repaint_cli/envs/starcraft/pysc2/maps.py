"""The mini-games as maps of the game: their files, and how long an episode may be."""

from pathlib import Path

from repaint_cli.envs.starcraft.rts.constants import LOOPS_PER_SECOND
from repaint_cli.envs.starcraft.rts.maps import MapSpec

FILES = {
    "build-marines": Path("mini_games/BuildMarines.SC2Map"),
    "find-and-defeat-zerglings": Path("mini_games/FindAndDefeatZerglings.SC2Map"),
}
"""Relative to the game's folder Maps. The third map nobody has published."""

RELEASE = "https://github.com/google-deepmind/pysc2/releases/tag/v1.2"
"""Where mini_games.zip is."""

SAFE_LOOPS = 14 * 60 * LOOPS_PER_SECOND
"""Of an episode on a map with a base that the game's process starts again. The mineral patch to
which the command centre sends SCVs is used up little later, and then missing ever after."""


def longest(spec: MapSpec, one_process: bool) -> int:
    """Return after how many loops an episode is cut off.

    Args:
        spec: the mini-game.
        one_process: whether a process plays more than one episode.
    """
    return min(spec.loops, SAFE_LOOPS) if one_process and spec.base else spec.loops
