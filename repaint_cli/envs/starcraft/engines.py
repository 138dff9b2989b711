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

OF_BOTH = {"camera": "map", "game_process": "each"}
"""What engines are compared with: the game's camera, which nobody can move, and all its time."""


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
        own = {"engine": name} | OF_BOTH
        alike = settings.model_copy(update=own)
        players = engine_of(alike, 1)
        try:
            events = timelines(players, width=alike.spec.camera.width)
            columns[name] = {event[1:]: event for event in events}
        finally:
            players.close()
    return table_of(columns)


def table_of(columns: dict[str, dict[tuple[str, int], Event]]) -> list[str]:
    """Return a line for everything that came, with the time in each engine; "-": it never came.

    Args:
        columns: what came in each engine, and last the end, by what it is and which of its kind.
    """
    ends = [list(events.values())[-1] for events in columns.values()]
    keys = dict.fromkeys(key for events in columns.values() for key in list(events)[:-1])
    first = {key: min(c[key].loop for c in columns.values() if key in c) for key in keys}
    lines = ["".join(f"{text:>16}" for text in ("", *(f"{name}, s" for name in columns)))]
    for what, number in sorted(keys, key=lambda key: first[key]):
        same = [events.get((what, number)) for events in columns.values()]
        times = [f"{event.loop / LOOPS_PER_SECOND:.1f}" if event else "-" for event in same]
        lines.append("".join(f"{text:>16}" for text in (f"{what} {number}", *times)))
    last = ["marines", *(str(event.number) for event in ends)]
    return [*lines, "".join(f"{text:>16}" for text in last)]
