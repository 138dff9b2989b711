"""The three maps: where things are, what may appear, and how long a game is.

Coordinates are the game's units, x to the right and y up, on a map of 64 × 64. MAP: read in the map
files of google-deepmind/pysc2. OWN: the paper says of its target task only that the map is larger,
foggy, and has 40 zerglings in unrevealed places that stay out of the base; the rest is ours.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

from repaint_cli.envs.starcraft.rts.constants import (
    LOOPS_PER_SECOND,
    LOOPS_PER_STEP,
    MAX_PATCHES,
    MAX_SCVS,
    MAX_ZERGLINGS,
)


class Rectangle(NamedTuple):
    """An area of the map, units."""

    left: float
    bottom: float
    right: float
    top: float


class Camera(NamedTuple):
    """What the screen shows: a square."""

    x: float
    """Of its middle, units."""
    y: float
    width: float
    """Of the square, units."""


BASE = Rectangle(19.936, 18.998, 45.936, 36.998)
"""The playable region of BuildMarines. MAP."""
CENTRE = (29.5, 27.5)
"""The command centre's middle: its point (29.825, 28.008), put on the axis of the patches. MAP."""
PATCHES = (
    (23.0, 28.5), (24.0, 29.5), (23.0, 26.5), (25.0, 22.5),
    (25.0, 32.5), (24.0, 23.5), (24.0, 31.5), (24.0, 25.5),
)  # fmt: skip
"""Middles of the mineral patches. MAP."""


@dataclass(frozen=True, kw_only=True)
class MapSpec:
    """A task's map and rules."""

    name: str
    """What the map is called."""
    region: Rectangle
    """Where units may be, units."""
    camera: Camera
    """What the screen shows."""
    base: Rectangle | None = None
    """Where structures may stand and zerglings may not; without one there is no economy."""
    centre: tuple[float, float] = CENTRE
    """Middle of the command centre, in a base, units."""
    patches: tuple[tuple[float, float], ...] = PATCHES
    """Middles of the mineral patches, in a base, units."""
    fog: bool = False
    """Whether only what units see is visible; else all of the region always is."""
    marines: int = 0
    """That are there at the start, selected, on a circle around the region's middle."""
    zerglings: int = 0
    """That are there at the start."""
    respawn: bool = True
    """Whether as many zerglings appear again when all are dead."""
    ends_without_marines: bool = False
    """Whether a game is over when no marine is left."""
    minutes: float = 15.0
    """Length of a game on its own clock, 960 loops a minute."""
    minerals: int = 1500
    """In each patch: BuildMarines sets 1500, the game's default is 1800. MAP."""
    start_scvs: int = 12
    """At the start, in a base. MAP."""
    scv_after_build: Literal["idle", "mine"] = "idle"
    """What an SCV does after it has built: the game has it idle."""
    award_on: Literal["complete", "order"] = "complete"
    """When trained units and barracks count for the reward terms."""
    illegal_site_is_unavailable: bool = True
    """Whether an order to build where one cannot counts as unavailable."""

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ValueError: a number is out of its range.
        """
        limits = {
            "minutes": (0.01, 24 * 60.0), "minerals": (0, 30_000), "start_scvs": (1, MAX_SCVS),
            "zerglings": (0, MAX_ZERGLINGS), "marines": (0, 100),
        }  # fmt: skip
        for setting, (low, high) in limits.items():
            value = getattr(self, setting)
            if not low <= value <= high:
                raise ValueError(f"expected {setting} from {low} to {high}, found {value}")
        if len(self.patches) > MAX_PATCHES:
            raise ValueError(f"expected at most {MAX_PATCHES} patches, found {len(self.patches)}")
        left, bottom, right, top = self.region
        if not (0.0 <= left <= right - 2.0 <= 62.0 and 0.0 <= bottom <= top - 2.0 <= 62.0):
            raise ValueError(
                f"expected a region of at least 2 × 2 units on a map of 64, found {self.region}"
            )
        if not 1.0 <= self.camera.width <= 256.0:
            raise ValueError(f"expected a camera 1 to 256 units wide, found {self.camera.width}")

    @property
    def loops(self) -> int:
        """Length of a game, loops."""
        return round(self.minutes * 60 * LOOPS_PER_SECOND)

    @property
    def steps(self) -> int:
        """Length of a game, steps of an agent."""
        return -(-self.loops // LOOPS_PER_STEP)


BUILD_MARINES = MapSpec(
    name="build-marines", region=BASE, base=BASE, camera=Camera(32.94, 25.0, 24.0)
)
"""DeepMind's BuildMarines. Its camera is panned to 3 below the region's middle. MAP."""
BUILD_MARINES_FDZ = MapSpec(
    name="build-marines-fdz", region=Rectangle(2.0, 2.0, 62.0, 62.0), base=BASE,
    camera=Camera(32.0, 32.0, 62.0), fog=True, zerglings=40,
)  # fmt: skip
"""The paper's target task: the same base on a larger map with fog and zerglings. OWN."""
FIND_AND_DEFEAT_ZERGLINGS = MapSpec(
    name="find-and-defeat-zerglings", region=Rectangle(10.0, 12.0, 54.0, 44.0),
    camera=Camera(32.0, 28.0, 46.0), fog=True, marines=3, zerglings=25, minutes=3.0,
    ends_without_marines=True,
)  # fmt: skip
"""DeepMind's FindAndDefeatZerglings, but for the camera, which shows all of it. MAP."""

MAPS: Mapping[str, MapSpec] = {
    spec.name: spec for spec in (BUILD_MARINES, BUILD_MARINES_FDZ, FIND_AND_DEFEAT_ZERGLINGS)
}
"""Maps by name."""
