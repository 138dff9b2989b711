"""Places for buildings in the base, and what stands there.

Places on the screen are (column, row), pixels; places of buildings are units from the middle of the
command centre, x to the east and y to the north.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.starcraft.rts.constants import LOOPS_PER_STEP, UnitData

Place = tuple[int, int]
Layer = NDArray[np.uint8]


DEPOT_SITES = [(x, -7.5) for x in np.arange(-7.5, 15, 2)] + [
    (x, -5.5) for x in np.arange(-1.5, 15, 2)
]
"""Along the south edge of the base, then in front of these, units."""

BARRACKS_SITES = [(x, y) for y in (6, 2, -2) for x in (6, 10, 14)]
"""In the east, with ways between them, units."""

PATIENCE = 40
"""Steps in which an ordered building must have begun, else the site is taken for a bad one."""


def steps_of(unit: UnitData) -> int:
    """Return how many steps a unit takes to be built or trained."""
    return unit.build_loops // LOOPS_PER_STEP


class Site:
    """A place for a building."""

    def __init__(self, place: Place, kind: int) -> None:
        """Take a pixel, and the kind that the layer `unit_type` shows of such a building."""
        self.place, self.kind = place, kind
        self.ordered: int | None = None
        """Since which step one is ordered here, until it stands."""
        self.stands: int | None = None
        """Since which step one stands here, finished or not."""
        self.failures = 0
        """How often nothing came of an order."""
        self.busy_until = 0
        """The step at which it will have trained all that is ordered."""

    def look(self, types: Layer, step: int) -> None:
        """See what stands here, and give up what was ordered too long ago."""
        x, y = self.place
        if self.stands is None and (types[y - 1 : y + 2, x - 1 : x + 2] == self.kind).any():
            self.stands, self.ordered = step, None
        if self.ordered is not None and step > self.ordered + PATIENCE:
            self.ordered, self.failures = None, self.failures + 1

    def is_finished(self, step: int, unit: UnitData) -> bool:
        """Return whether one stands here since the time that it takes to build."""
        return self.stands is not None and step >= self.stands + steps_of(unit)


def sites_of(
    places: Iterable[tuple[float, float]], middle: tuple[float, float], scale: float, kind: int
) -> Iterable[Site]:
    """Yield the sites at these places.

    Args:
        places: units from the middle of the command centre.
        middle: of the command centre, pixels.
        scale: pixels a unit.
        kind: of building, as the layer `unit_type` shows it.
    """
    for x, y in places:
        yield Site((int(middle[0] + scale * x), int(middle[1] - scale * y)), kind)
