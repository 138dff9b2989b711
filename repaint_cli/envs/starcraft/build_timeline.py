"""When things come in an engine that plays the build order: to compare engines by."""

from typing import NamedTuple

import numpy as np

from repaint_cli.envs.starcraft.build_order import BuildOrder
from repaint_cli.envs.starcraft.engine import Engine
from repaint_cli.envs.starcraft.rts.constants import (
    BARRACKS_BUILT,
    DEPOT,
    LOOPS_PER_STEP,
    MARINE_BUILT,
    MEASUREMENTS,
)

FOOD_CAP = MEASUREMENTS.index("food_cap")

MARINES = 10
"""Every so many marines are an event."""


class Event(NamedTuple):
    """Something that has come."""

    loop: int
    """When, in the game's loops, 16 a second."""
    what: str
    """"supply depot", "barracks", "marine", or "end", of the episode."""
    number: int
    """Which of its kind it is, from 1; at the end, how many marines were built."""


def timelines(
    engine: Engine, scvs: int = 20, barracks: int = 7, *, width: float, seed: int = 0
) -> list[Event]:
    """Play the build order for an episode; return when each building and every tenth marine came.

    Args:
        engine: of one game of `build-marines`.
        scvs: how many to have.
        barracks: how many to have.
        width: of what the engine's screen shows, units.
        seed: of the episode.

    Raises:
        GameError: the real game is played, and does not run.
    """
    engine.reset(np.array([seed], np.int64))
    observation = engine.observe()
    order = BuildOrder(observation, scvs, barracks, width)
    counted = {"supply depot": 0, "barracks": 0, "marine": 0}
    first_cap = int(observation.measurements[0, FOOD_CAP])
    events, loop, over = list[Event](), 0, False
    while not over:
        terms, terminated, truncated = engine.step(order.act(observation)[None])
        over, loop = bool(terminated[0] or truncated[0]), loop + LOOPS_PER_STEP
        observation = engine.observe()
        cap = int(observation.measurements[0, FOOD_CAP])
        now = {
            "supply depot": -((first_cap - cap) // -DEPOT.supply),
            "barracks": counted["barracks"] + int(terms[0, BARRACKS_BUILT]),
            "marine": counted["marine"] + int(terms[0, MARINE_BUILT]),
        }
        for what, before in counted.items():
            events += [
                Event(loop, what, number)
                for number in range(before + 1, now[what] + 1)
                if what != "marine" or number == 1 or number % MARINES == 0
            ]
        counted = now
    return [*events, Event(loop, "end", counted["marine"])]
