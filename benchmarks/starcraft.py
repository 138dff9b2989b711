"""Environment steps per second of the mini-RTS of StarCraft II, with its layers and without.

    python benchmarks/starcraft.py

One thread, 32 games. Actions are random, or a scripted build order has been played up to 120
marines; on the larger map these run about among 40 zerglings. The game itself, through PySC2, is
said to do about 28 steps a second ("10x real-time is not uncommon", docs/environment.md).
"""

from collections.abc import Callable, Iterator
from functools import partial
from time import perf_counter

import numpy as np
from turns import Measurements, Table, median, run, span

GAMES = 32
MAPS = ("build-marines", "build-marines-fdz", "find-and-defeat-zerglings")
PYSC2 = 28.0
"""Steps per second of a process of the game, by PySC2's documentation."""
SECONDS = 2.0


def steps_per_second(name: str, marines: int, draws: bool, threads: int = 1) -> float:
    """Act at random for some seconds; return steps per second over all games."""
    from repaint_cli.envs.starcraft.rts.constants import ATTACK_POINT, SELECT_ARMY
    from repaint_cli.envs.starcraft.rts.engine import MiniRTS, Observation
    from repaint_cli.envs.starcraft.rts.maps import MAPS

    rts, rng = MiniRTS(MAPS[name], GAMES, threads), np.random.default_rng(0)
    seen = Observation.empty(GAMES)
    rts.reset(np.arange(GAMES))
    state = rts.state
    state.marine_hp[:, :marines], state.army_count[:] = 45, np.maximum(state.army_count, marines)
    state.marine_x[:, :marines] = rng.uniform(30, 44, (GAMES, marines))
    state.marine_y[:, :marines] = rng.uniform(20, 36, (GAMES, marines))
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
