"""How episodes of the mini-games went: what was built, killed and mined.

**S** seeds · **E** episodes a seed.
"""

import numpy as np

from repaint_cli.envs.episodes import Episodes

OUTCOMES = {
    "marines_built": "marines",
    "zerglings_killed": "killed",
    "marines_died": "lost",
    "barracks_built": "barracks",
    "scvs": "SCVs",
    "food_cap": "supply",
    "minerals_mined": "mined",
}
"""What is reported of an episode, by name, with the heads of a table's columns: marines built and
lost, zerglings killed, barracks built, SCVs and supply there are, minerals mined."""

GOALS = ("marines_built", "zerglings_killed")
"""The outcomes that are shown with an interval."""


def outcome(episodes: Episodes, name: str) -> np.ndarray:
    """Return an outcome of `OUTCOMES` by the end of each episode, (S, E)."""
    last = episodes.last(name if name in episodes.records else f"sum_{name}")
    assert last is not None
    return last
