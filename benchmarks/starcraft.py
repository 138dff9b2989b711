"""Environment steps per second of the mini-RTS of StarCraft II, with its layers and without.

    python benchmarks/starcraft.py

One thread, 32 games. Actions are random. In some rows each game begins with 120 marines in the
base, which stand, or on the larger map run about among 40 zerglings. The game itself, through
PySC2, is said to do about 28 steps a second ("10x real-time is not uncommon", docs/environment.md).
"""

from collections.abc import Callable, Iterator
from functools import partial
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from turns import Measurements, Table, median, run, span

if TYPE_CHECKING:
    from repaint_cli.envs.starcraft.rts.engine import MiniRTS

GAMES = 32
MAPS = ("build-marines", "build-marines-fdz", "find-and-defeat-zerglings")
PYSC2 = 28.0
"""Steps per second of a process of the game, by PySC2's documentation."""
SECONDS = 2.0
LEAST_LEFT = 0.8
"""Of the marines, over all games, when the time is up: zerglings kill some."""


def put_marines(rts: "MiniRTS", rows: NDArray[np.intp], n: int, rng: np.random.Generator) -> None:
    """Put so many marines into the base of games that begin."""
    if n == 0:
        return
    state = rts.state
    state.marine_hp[rows, :n], state.army_count[rows] = 45, n
    state.food_used[rows] += n
    state.marine_x[rows, :n] = rng.uniform(30, 44, (len(rows), n))
    state.marine_y[rows, :n] = rng.uniform(20, 36, (len(rows), n))


def steps_per_second(name: str, marines: int, draws: bool, threads: int = 1) -> float:
    """Act at random for some seconds; return steps per second over all games."""
    from repaint_cli.envs.starcraft.rts.constants import ATTACK_POINT, SELECT_ARMY
    from repaint_cli.envs.starcraft.rts.engine import MiniRTS, Observation
    from repaint_cli.envs.starcraft.rts.maps import MAPS

    rts, rng = MiniRTS(MAPS[name], GAMES, threads), np.random.default_rng(0)
    seen = Observation.empty(GAMES)
    rts.reset(np.arange(GAMES))
    put_marines(rts, np.arange(GAMES), marines, rng)
    actions = np.stack([rng.integers(0, end, (400, GAMES)) for end in (7, 84, 84)], axis=2)
    if marines and rts.spec.zerglings:
        actions[::2, :, 0], actions[1::2, :, 0] = SELECT_ARMY, ATTACK_POINT
    rts.step(actions[0])  # compiles
    rts.observe(out=seen)
    steps, started = 0, perf_counter()
    while perf_counter() - started < SECONDS:
        _, terminated, truncated = rts.step(actions[steps // GAMES % 400])
        if draws:
            rts.observe(out=seen)
        steps += GAMES
        if (terminated | truncated).any():
            rows = np.flatnonzero(terminated | truncated)
            rts.reset(rows + steps, rows)
            put_marines(rts, rows, marines, rng)
    assert rts.state.army_count.mean() >= LEAST_LEFT * marines
    return steps / (perf_counter() - started)


SIDES: dict[str, Callable[[], float]] = {
    f"{name}, {marines} marines, {'layers' if draws else 'no layers'}": partial(
        steps_per_second, name, marines, draws
    )
    for name in MAPS
    for marines in ((0, 120) if name != MAPS[-1] else (0,))
    for draws in (True, False)
}
SIDES["build-marines, 0 marines, layers, two threads"] = partial(
    steps_per_second, MAPS[0], 0, True, 2
)


def tables(measured: Measurements) -> Iterator[Table]:
    """Yield steps per second, beside what the game does."""
    rows = [
        (side, median(rates, ",.0f"), span(rates / PYSC2, ",.0f"))
        for side, rates in measured.items()
    ]
    yield Table(("32 games", "steps/s", ": the game through PySC2"), rows)


if __name__ == "__main__":
    run(__file__, __doc__, SIDES, tables)
