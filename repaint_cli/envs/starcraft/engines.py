"""Which engine plays a card's games: our simulator, or the game itself."""

from pathlib import Path
from typing import TYPE_CHECKING

from repaint_cli.envs.starcraft.rts.engine import MiniRTS

if TYPE_CHECKING:
    from repaint_cli.envs.starcraft.engine import Engine
    from repaint_cli.envs.starcraft.simulator import StarCraftSimulator


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
