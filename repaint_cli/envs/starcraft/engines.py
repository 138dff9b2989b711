"""Which engine plays a card's games: our simulator, or the game itself."""

from typing import TYPE_CHECKING

from repaint_cli.envs.starcraft.rts.engine import MiniRTS

if TYPE_CHECKING:
    from repaint_cli.envs.starcraft.engine import Engine
    from repaint_cli.envs.starcraft.simulator import StarCraftSimulator


def engine_of(settings: "StarCraftSimulator", n: int) -> "Engine":
    """Return an engine of N games of a card's map.

    Raises:
        CardError: the game is asked for, and it or one of its files is not there.
    """
    if settings.engine == "mini":
        return MiniRTS(settings.spec, n)
    from repaint_cli.envs.starcraft.real import RealEngine

    return RealEngine(settings.spec, n)
