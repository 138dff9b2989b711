"""Which engine plays a card's games: our simulator, or the game itself."""

from pathlib import Path
from typing import TYPE_CHECKING

from repaint_cli.envs.starcraft.build_timeline import Event, timelines
from repaint_cli.envs.starcraft.rts.constants import LOOPS_PER_SECOND
from repaint_cli.envs.starcraft.rts.engine import MiniRTS
from repaint_cli.errors import CardError

if TYPE_CHECKING:
    from repaint_cli.envs.starcraft.engine import Engine
    from repaint_cli.envs.starcraft.simulator import StarCraftSimulator

ENGINES = ("mini", "pysc2")
"""What may play, by the setting `engine`."""


def engine_of(settings: "StarCraftSimulator", n: int) -> "Engine":
    """Return an engine of N games of a card's map.

    Raises:
        GameError: the game itself is asked for, and it, its map or PySC2 is not there.
    """
    if settings.engine == "mini":
        return MiniRTS(settings.spec, n)
    from repaint_cli.envs.starcraft.pysc2.engine import RealEngine

    return RealEngine(
        settings.spec,
        n,
        file=Path(settings.map_file) if settings.map_file else None,
        version=settings.game_version,
        one_process=settings.game_process == "one",
    )


def side_by_side(settings: "StarCraftSimulator", engine: str) -> list[str]:
    """Play a fixed build order in our simulator and in another engine; return when what came.

    Raises:
        CardError: there is no such engine, or nothing is built on the card's map.
        GameError: the game is asked for, and it, its map or PySC2 is not there, or it stops.
    """
    if engine not in ENGINES:
        raise CardError(f"expected --engine {' or '.join(ENGINES)}, found '{engine:.60}'")
    if settings.map != "build-marines":
        raise CardError(f"expected the map build-marines for a build order, found {settings.map}")
    columns = {}
    for name in dict.fromkeys((engine, "mini")):  # what may be absent comes first
        own = {"engine": name, "camera": "map"}  # the game's, which nobody can move
        players = engine_of(settings.model_copy(update=own), 1)
        try:
            columns[name] = {event[1:]: event for event in timelines(players)}
        finally:
            players.close()
    return table_of(columns)


def table_of(columns: dict[str, dict[tuple[str, int], Event]]) -> list[str]:
    """Return a line for everything that came, with the time in each engine; "-": it never came."""
    ends = {name: events.popitem()[1] for name, events in columns.items()}
    keys = dict.fromkeys(key for events in columns.values() for key in events)
    first = {key: min(c[key].loop for c in columns.values() if key in c) for key in keys}
    lines = ["".join(f"{text:>16}" for text in ("", *(f"{name}, s" for name in columns)))]
    for what, number in sorted(keys, key=lambda key: first[key]):
        found = [events.get((what, number)) for events in columns.values()]
        times = [f"{event.loop / LOOPS_PER_SECOND:.1f}" if event else "-" for event in found]
        lines.append("".join(f"{text:>16}" for text in (f"{what} {number}", *times)))
    last = ["marines", *(str(event.number) for event in ends.values())]
    return [*lines, "".join(f"{text:>16}" for text in last)]
