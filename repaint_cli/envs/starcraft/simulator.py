"""StarCraft II's mini-games with their settings, behind the interface of simulators."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

from pydantic import Field, field_validator, model_validator

from repaint_cli.envs.simulator import Simulator
from repaint_cli.envs.starcraft.names import RECORDS, TERMS
from repaint_cli.envs.starcraft.rts.constants import COMMANDS, MAX_SCVS, MAX_ZERGLINGS
from repaint_cli.envs.starcraft.rts.maps import BUILD_MARINES_FDZ, MAPS, Camera, MapSpec, Rectangle
from repaint_cli.errors import RenderError
from repaint_cli.settings import EvalConfig

if TYPE_CHECKING:
    from repaint_cli.envs.episodes import Column, Episodes
    from repaint_cli.envs.simulator import Environments
    from repaint_cli.envs.starcraft.timeline import Timelines

LARGE_MAP = "build-marines-fdz"
"""The map whose size a card may choose."""
MIDDLE, MARGIN = 32.0, 1.0
"""Of that map; and how much further its camera sees on each side, units."""


class StarCraftSimulator(Simulator):
    """StarCraft II's mini-games: in a simulator of our own, or in the game itself."""

    simulator: Literal["starcraft"]
    """Which simulator this is."""
    map: Literal["build-marines", "build-marines-fdz", "find-and-defeat-zerglings"] = (
        "build-marines"
    )
    """Build marines; build them and kill the zerglings around the base; or only the latter."""
    engine: Literal["mini", "pysc2"] = "mini"
    """Who plays: our simulator ("mini"), or the game itself by PySC2."""
    minutes: float | None = Field(None, ge=0.01, le=60)
    """Time limit of an episode, in minutes of the game's own clock, of 120 steps each; absent: 15,
    or 3 where nothing is built."""
    map_size: int | None = Field(None, ge=40, le=60)
    """Side of the playable square of build-marines-fdz, units; absent: 60. The paper says only that
    this map is the larger one."""
    camera: Literal["map", "large"] = "map"
    """What the screen shows: all of this map that can be played on, or what it shows of
    build-marines-fdz, where the base is then at the same pixels."""
    layers: Literal["terran", "coach-prefix"] = "terran"
    """Which of PySC2's layers the pictures have: those that are not empty in these games, or the
    first nine and the first three. The paper does not name them."""
    scvs: int = Field(12, ge=1, le=MAX_SCVS)
    """SCVs that an episode begins with."""
    minerals: int = Field(1500, ge=1, le=10_000)
    """What each patch of minerals holds; 1,500 in the map's own script, 1,800 in the game."""
    scv_after_build: Literal["idle", "mine"] = "idle"
    """What an SCV does that has built something: it waits, as in the game, or goes back to mine."""
    award_on: Literal["complete", "order"] = "complete"
    """Whether SCVs, barracks and marines are paid for when they are there, or when ordered."""
    illegal_site: Literal["unavailable", "ignored"] = "unavailable"
    """Whether ordering a building where none can stand counts as an unavailable action."""
    zerglings: int | None = Field(None, ge=1, le=MAX_ZERGLINGS)
    """Zerglings on the map; absent: 40, or 25 where nothing is built."""
    respawn: bool = True
    """Whether as many zerglings come again when all are dead."""
    map_file: str | None = None
    """A map of your own for the game itself (`my-map.SC2Map`), which knows no build-marines-fdz."""
    game_version: str | None = None
    """Which version of the game itself plays, such as "4.10"; absent: the newest installed."""
    game_process: Literal["one", "each"] = "one"
    """Whether one process of the game itself plays all episodes, of at most 14 minutes then, or
    each episode has a new one, which takes its seed."""

    @field_validator("map_file")
    @classmethod
    def _from_any_folder(cls, name: str | None) -> str | None:
        """Keep the file's whole path: a run or a teacher is used in other folders too."""
        return None if name is None else str(Path(name).absolute())

    @model_validator(mode="after")
    def _of_its_map(self) -> Self:
        """Refuse settings that this map does not have."""
        if self.zerglings is not None and not MAPS[self.map].zerglings:
            raise ValueError(f"expected no env.zerglings, as there are none on the map {self.map}")
        if self.map_size is not None and self.map != LARGE_MAP:
            raise ValueError(f"expected no env.map_size, as the map {self.map} has its own")
        if self.map_file is not None and self.engine == "mini":
            raise ValueError("expected no env.map_file, which only env.engine pysc2 can read")
        return self

    @property
    def spec(self) -> MapSpec:
        """The map and its rules."""
        own = MAPS[self.map]
        if self.map_size is not None:
            low, high = MIDDLE - self.map_size / 2, MIDDLE + self.map_size / 2
            camera = Camera(MIDDLE, MIDDLE, self.map_size + 2 * MARGIN)
            own = replace(own, region=Rectangle(low, low, high, high), camera=camera)
        if self.camera == "large" and self.map != LARGE_MAP:
            own = replace(own, camera=BUILD_MARINES_FDZ.camera)
        return replace(
            own,
            minutes=own.minutes if self.minutes is None else self.minutes,
            zerglings=own.zerglings if self.zerglings is None else self.zerglings,
            respawn=self.respawn,
            minerals=self.minerals,
            start_scvs=self.scvs,
            scv_after_build=self.scv_after_build,
            award_on=self.award_on,
            illegal_site_is_unavailable=self.illegal_site == "unavailable",
        )

    # Environments

    def make(self, n_envs: int, one_episode: bool, noise: EvalConfig | None) -> "Environments":
        """Make N games; see `Simulator.make`."""
        from gymnasium.vector import AutoresetMode

        from repaint_cli.envs.starcraft.engines import engine_of
        from repaint_cli.envs.starcraft.env import StarCraftVectorEnv

        return StarCraftVectorEnv(
            engine_of(self, n_envs), n_envs, layers=self.layers,
            autoreset_mode=AutoresetMode.DISABLED if one_episode else AutoresetMode.NEXT_STEP,
        )  # fmt: skip

    def longest_episode(self) -> int:
        """Return the time limit, in steps."""
        return self.spec.steps

    def settled(self) -> Self:
        """Return the settings with the values that follow from the map; see `Simulator.settled`."""
        spec = self.spec
        sizes = (
            {"map_size": round(spec.region.right - spec.region.left)}
            if self.map == LARGE_MAP
            else {}
        )
        found = {"minutes": spec.minutes, "zerglings": spec.zerglings or None}
        return self.model_copy(update=found | sizes)

    @property
    def records(self) -> tuple[str, ...]:
        """What of the infos of a step is worth keeping, by name."""
        return RECORDS

    # The task

    @property
    def platform(self) -> str:
        """The paper's StarCraft II."""
        return "starcraft"

    @property
    def choices(self) -> tuple[str, ...]:
        """The commands."""
        return COMMANDS

    @property
    def reward_terms(self) -> frozenset[str]:
        """All terms that it can pay."""
        return frozenset(TERMS)

    # Files that a card brings along

    @classmethod
    def resolve_files(cls, env: dict[str, Any], folder: Path) -> dict[str, Any]:
        """Return [env] with the map beside the card; see `Simulator.resolve_files`."""
        name = env.get("map_file")
        return env | {"map_file": str(folder / name)} if isinstance(name, str) else env

    def files(self) -> dict[str, Path]:
        """Return the map's file, if it is the user's."""
        return {"map_file": Path(self.map_file)} if self.map_file else {}

    def beside(self, engine: str) -> list[str]:
        """Play a build order in our simulator and in another engine; see `Simulator.beside`."""
        from repaint_cli.envs.starcraft.engines import side_by_side

        return side_by_side(self, engine)

    # How episodes went

    score_episodes: ClassVar[int] = 20

    def columns(self, episodes: "Episodes", s: int) -> "list[Column]":
        """Return what was built and killed; see `Simulator.columns`."""
        from repaint_cli.envs.episodes import Column
        from repaint_cli.envs.starcraft.outcomes import GOALS, OUTCOMES, outcome

        return [
            Column(head, outcome(episodes, name)[s], "interval" if name in GOALS else "mean")
            for name, head in OUTCOMES.items()
        ]

    def outcomes(self, episodes: "Episodes") -> dict[str, Any]:
        """Return what was built, killed and mined, by episode, as JSON."""
        from repaint_cli.envs.starcraft.outcomes import OUTCOMES, outcome

        return {name: outcome(episodes, name).tolist() for name in OUTCOMES}

    # Timelines and films

    @property
    def place(self) -> str:
        """The same clock runs on every map."""
        return self.simulator

    @property
    def paths(self) -> "Timelines":
        """What was there, built and killed over the time of an episode."""
        from repaint_cli.envs.starcraft.timeline import Timelines

        return Timelines(self.spec.base is not None, self.spec.zerglings > 0)

    filmed_episodes: ClassVar[int] = 1

    def film(self, episodes: "Episodes", path: Path, title: str, n_episodes: int) -> None:
        """Play episodes again, and film the map beside what the agent sees; see `Simulator.film`.

        Raises:
            RenderError: the game itself was played, which records its own replays.
        """
        if self.engine != "mini":
            raise RenderError("expected env.engine 'mini' for a film; the game has its own replays")
        from repaint_cli.envs.starcraft.film import film

        film(self, episodes, path, title, n_episodes)
