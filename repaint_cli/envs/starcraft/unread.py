"""Settings that one engine or map reads and another does not: none is silently without effect."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from repaint_cli.envs.starcraft.rts.maps import MAPS

if TYPE_CHECKING:
    from repaint_cli.envs.starcraft.simulator import StarCraftSimulator

LARGE_MAP = "build-marines-fdz"
"""The map whose size a card may choose."""


class Readers(NamedTuple):
    """Who reads a setting."""

    engine: str | None = None
    """The only engine that does; None is each."""
    base: bool = False
    """Whether only maps do on which something is built."""
    zerglings: bool = False
    """Whether only maps do that have zerglings."""
    map: str | None = None
    """The only map that does; None is each that is left."""


RULE = Readers("mini", base=True)
FOES = Readers("mini", zerglings=True)
READERS: Mapping[str, Readers] = {
    "map_file": Readers("pysc2"),
    "game_version": Readers("pysc2"),
    "game_process": Readers("pysc2"),
    "map_size": Readers(map=LARGE_MAP),
    "scvs": RULE,
    "minerals": RULE,
    "scv_after_build": RULE,
    "award_on": RULE,
    "illegal_site": RULE,
    "zerglings": FOES,
    "respawn": FOES,
}
"""The settings that not all engines and maps read."""


def complaint(settings: "StarCraftSimulator") -> str | None:
    """Return what is wrong with the first setting that is said and that nobody reads, or None.

    A value that says no more than the default is none that is said.
    """
    spec = MAPS[settings.map]
    for name, readers in READERS.items():
        default = type(settings).model_fields[name].default
        value = getattr(settings, name)
        if value == default or (name == "zerglings" and value == spec.zerglings):
            continue
        why = _why_unread(readers, settings)
        if why:
            wanted = "no env.{}" if default is None else "env.{}={}"
            shown = str(default).lower() if isinstance(default, bool) else default
            return f"expected {wanted.format(name, shown)}, {why}"
    return None


def _why_unread(readers: Readers, settings: "StarCraftSimulator") -> str | None:
    """Return why this engine or this map does not read a setting, or None if they do."""
    spec = MAPS[settings.map]
    if readers.map not in (None, settings.map):
        return f"as the map {settings.map} has its own"
    if readers.base and spec.base is None:
        return f"as nothing is built on the map {settings.map}"
    if readers.zerglings and not spec.zerglings:
        return f"as there are no zerglings on the map {settings.map}"
    if readers.engine not in (None, settings.engine):
        return f"as only env.engine {readers.engine} reads it"
    return None
