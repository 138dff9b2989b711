"""A fixed way to build marines, played in any engine: the same in our simulator and in the game.

It sees what an agent sees, and no more: layers of the screen, measurements, and which commands are
available. Its timeline in both engines shows how true the simulator is.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from repaint_cli.envs.starcraft.build_sites import (
    BARRACKS_SITES,
    DEPOT_SITES,
    Layer,
    Place,
    Site,
    sites_of,
    steps_of,
)
from repaint_cli.envs.starcraft.rts.constants import (
    BARRACKS,
    BARRACKS_TYPE,
    BUILD_BARRACKS,
    BUILD_DEPOT,
    CENTRE_TYPE,
    DEPOT,
    DEPOT_TYPE,
    MARINE,
    MEASUREMENTS,
    SCREEN,
    SCREEN_LAYERS,
    SCV,
    SCV_TYPE,
    SELECT_POINT,
    SELF,
    TRAIN_MARINE,
    TRAIN_SCV,
)
from repaint_cli.envs.starcraft.rts.engine import Observation
from repaint_cli.envs.starcraft.rts.maps import BUILD_MARINES

SOON, SOON_EACH = 2, 1.4
"""A depot is ordered when no more supply than this is left, and this for each finished barracks."""

COSTS = {
    BUILD_DEPOT: DEPOT.cost, BUILD_BARRACKS: BARRACKS.cost, TRAIN_SCV: SCV.cost,
    TRAIN_MARINE: MARINE.cost,
}  # fmt: skip
"""Of commands, minerals."""

AHEAD = 12
"""Steps before a building has trained a unit at which the next one is ordered."""


MINERS = (-5.0, 1.5)
"""Where an SCV mines at nearly every time, units from the middle of the command centre: to the
east, and to the south."""


class Wish(NamedTuple):
    """A command for what must be selected first."""

    command: int
    """Of `COMMANDS`."""
    select: Place
    """The pixel to click before."""
    site: Site | None = None
    """Where to build, or what trains; None is the command centre."""


class BuildOrder:
    """Supply depots when they will be needed, then SCVs, then barracks, and marines of the rest.

    Every command takes two steps, as its building or SCV is selected before.
    """

    def __init__(
        self,
        observation: Observation,
        scvs: int = 20,
        barracks: int = 7,
        width: float = BUILD_MARINES.camera.width,
        by_miners: bool = False,
    ) -> None:
        """Look where the command centre is.

        Args:
            observation: of the episode's beginning; only its first game is looked at.
            scvs: how many to have.
            barracks: how many to have.
            width: of what the screen shows, units.
            by_miners: whether an SCV of the minerals builds, always clicked at about the same
                place, or the nearest one that does not build.
        """
        self._scvs, self._barracks, self._step = scvs, barracks, 0
        self._by_miners = by_miners
        self._scale = SCREEN / width  # pixels a unit
        rows, columns = np.nonzero(_layer(observation, "unit_type") == CENTRE_TYPE)
        middle = columns.mean() + 0.5, rows.mean() + 0.5
        self._centre = Site((int(middle[0]), int(middle[1])), CENTRE_TYPE)
        self._miners = tuple(int(m + self._scale * d) for m, d in zip(middle, MINERS, strict=True))
        self._depots = list(sites_of(DEPOT_SITES, middle, self._scale, DEPOT_TYPE))
        self._halls = list(sites_of(BARRACKS_SITES, middle, self._scale, BARRACKS_TYPE))
        self._first = self._numbers(observation)
        self._wish: Wish | None = None
        self._given: Wish | None = None

    def act(self, observation: Observation) -> NDArray[np.int16]:
        """Return the action for what the first game shows, (3,)."""
        if self._given is not None:
            self._note(self._given)
        types = _layer(observation, "unit_type")
        for site in (*self._depots, *self._halls):
            site.look(types, self._step)
        before, self._wish = self._wish, self._next(observation, types)
        self._given = before if before is not None and self._may(before, observation) else None
        self._step += 1
        if self._given is not None:
            site = self._given.site or self._centre
            builds = self._given.command in (BUILD_DEPOT, BUILD_BARRACKS)
            return np.array((self._given.command, *(site.place if builds else (0, 0))), np.int16)
        place = self._wish.select if self._wish else self._centre.place
        return np.array((SELECT_POINT, *place), np.int16)

    def passed_over(self) -> None:
        """Forget the last action, in place of which another one was taken."""
        self._given = None

    def _may(self, before: Wish, observation: Observation) -> bool:
        """Return whether the last step's wish can be carried out, and is still one."""
        wanted = self._wish is not None and self._wish.command == before.command
        affordable = (
            self._numbers(observation)["minerals"] - self._promised() >= COSTS[before.command]
        )
        return wanted and affordable and bool(observation.available[0, before.command])

    def _note(self, given: Wish) -> None:
        """Remember that a command was given; the next one needs a selection of its own."""
        site, step, self._wish = given.site or self._centre, self._step - 1, None
        if given.command in (BUILD_DEPOT, BUILD_BARRACKS):
            site.ordered = step
        else:
            unit = SCV if given.command == TRAIN_SCV else MARINE
            site.busy_until = max(site.busy_until, step) + steps_of(unit)

    def _next(self, observation: Observation, types: Layer) -> Wish | None:
        """Return what to do next, as soon as there are minerals for it; None where it must wait."""
        has = self._numbers(observation)
        room = has["food_cap"] - has["food_used"]
        if self._wants_depot(has):
            return self._build(BUILD_DEPOT, self._depots, types)
        if room > 0 and self._wants_scv(has):
            return Wish(TRAIN_SCV, self._centre.place)
        if self._wants_barracks(has):
            return self._build(BUILD_BARRACKS, self._halls, types)
        return self._train(types) if room > 0 else None

    def _promised(self) -> int:
        """Return the minerals that buildings will take which are ordered and not begun."""
        both = ((self._depots, DEPOT), (self._halls, BARRACKS))
        return sum(unit.cost for sites, unit in both for site in sites if site.ordered is not None)

    def _wants_depot(self, has: dict[str, int]) -> bool:
        """Return whether supply runs out before another depot would be finished."""
        finished = sum(site.is_finished(self._step, BARRACKS) for site in self._halls)
        coming = sum(
            site.ordered is not None
            or (site.stands is not None and not site.is_finished(self._step, DEPOT))
            for site in self._depots
        )
        soon = SOON + round(SOON_EACH * finished)
        room = has["food_cap"] - has["food_used"] - DEPOT.supply * coming
        return room <= soon and has["food_cap"] < 200

    def _wants_scv(self, has: dict[str, int]) -> bool:
        marines = sum(
            -((site.busy_until - self._step) // -steps_of(MARINE))
            for site in self._halls
            if site.busy_until > self._step
        )
        ordered = has["food_used"] - has["army"] - marines
        return ordered < self._scvs and self._centre.busy_until <= self._step + 2

    def _wants_barracks(self, has: dict[str, int]) -> bool:
        there = sum(site.stands is not None or site.ordered is not None for site in self._halls)
        return there < self._barracks and has["food_cap"] > self._first["food_cap"]

    def _build(self, command: int, sites: list[Site], types: Layer) -> Wish | None:
        """Return a wish to build at the best free site."""
        free = [site for site in sites if site.stands is None and site.ordered is None]
        rows, columns = self._builders(types)
        if not free or not len(rows):
            return None
        site = min(free, key=lambda one: one.failures)
        x, y = self._miners if self._by_miners else site.place
        nearest = np.argmin((columns - x) ** 2 + (rows - y) ** 2)
        return Wish(command, (int(columns[nearest]), int(rows[nearest])), site)

    def _builders(self, types: Layer) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the rows and columns of the pixels of SCVs that do not build."""
        rows, columns = np.nonzero(types == SCV_TYPE)
        for near, data in ((self._depots, DEPOT), (self._halls, BARRACKS)):
            for site in near:
                if site.stands is not None and not site.is_finished(self._step, data):
                    reach = (data.radius + 1) * self._scale
                    far = np.maximum(abs(columns - site.place[0]), abs(rows - site.place[1]))
                    rows, columns = rows[far > reach], columns[far > reach]
        return rows, columns

    def _train(self, types: Layer) -> Wish | None:
        """Return a wish for a marine of the barracks that is free first."""
        halls = [site for site in self._halls if site.is_finished(self._step, BARRACKS)]
        halls = [site for site in halls if site.busy_until <= self._step + AHEAD]
        near = round(1.1 * self._scale)
        for site in sorted(halls, key=lambda one: one.busy_until):
            left, top = (place - near for place in site.place)
            around = types[top : top + 2 * near + 1, left : left + 2 * near + 1]
            rows, columns = np.nonzero(around == BARRACKS_TYPE)
            if len(rows):
                i = len(rows) // 2
                return Wish(TRAIN_MARINE, (left + int(columns[i]), top + int(rows[i])), site)
        return None

    @staticmethod
    def _numbers(observation: Observation) -> dict[str, int]:
        return dict(zip(MEASUREMENTS, observation.measurements[0].tolist(), strict=True))


def _layer(observation: Observation, name: str) -> Layer:
    """Return a layer of the first game's screen, where it shows what is ours; else 0."""
    own = observation.screen[0, SCREEN_LAYERS.index("player_relative")] == SELF
    return np.where(own, observation.screen[0, SCREEN_LAYERS.index(name)], 0).astype(np.uint8)
