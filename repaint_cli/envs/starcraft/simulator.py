"""StarCraft II's mini-games with their settings, behind the interface of simulators."""

from os.path import expanduser
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

from pydantic import Field, field_validator, model_validator

from repaint_cli.envs.simulator import Simulator
from repaint_cli.envs.starcraft.chosen_map import chosen_map, own_camera
from repaint_cli.envs.starcraft.names import RECORDS
from repaint_cli.envs.starcraft.pysc2.maps import longest
from repaint_cli.envs.starcraft.rts.constants import (
    COMMANDS,
    LOOPS_PER_STEP,
    MAX_SCVS,
    MAX_ZERGLINGS,
    TERMS,
)
from repaint_cli.envs.starcraft.rts.maps import MapSpec
from repaint_cli.envs.starcraft.unread import LARGE_MAP, complaint
from repaint_cli.errors import RenderError
from repaint_cli.settings import EvalConfig

if TYPE_CHECKING:
    from repaint_cli.envs.episodes import Column, Episodes
    from repaint_cli.envs.simulator import Environments
    from repaint_cli.envs.starcraft.timeline import Timelines

FEW_GAMES = 2
"""Episodes of the game itself that a score is of: each is a process of 1 to 2 GB."""


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
    """What the screen shows: all of this map that can be played on, or the 62 units that it shows
    of a whole build-marines-fdz, so that the base is at the same pixels on both maps."""
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
    game_process: Literal["one", "each"] = "each"
    """Whether each episode of the game itself has a new process, which takes its seed, or one
    process plays all episodes of an environment, of at most 14 minutes then."""

    @field_validator("map_file")
    @classmethod
    def _from_any_folder(cls, name: str | None) -> str | None:
        """Keep the file's whole path: a run or a teacher is used in other folders too."""
        return None if name is None else str(Path(expanduser(name)).absolute())

    @field_validator("game_version", mode="before")
    @classmethod
    def _in_quotation_marks(cls, version: Any) -> Any:
        """Refuse a number: 4.10 would be 4.1."""
        if isinstance(version, int | float):
            raise ValueError("expected quotation marks, as in --set 'env.game_version=\"4.10\"'")
        return version

    @model_validator(mode="after")
    def _of_its_map(self) -> Self:
        """Refuse settings that this map or this engine does not have."""
        if problem := complaint(self):
            raise ValueError(problem)
        if self.engine == "pysc2" and self.spec.camera != own_camera(self) and not self.map_file:
            raise ValueError(
                f"the game's own camera on {self.map} cannot be moved; set env.camera=map, or name "
                "a map with another camera in env.map_file"
            )
        return self

    @property
    def spec(self) -> MapSpec:
        """The map and its rules."""
        return chosen_map(self)

    # Environments

    def make(
        self, n_envs: int, one_episode: bool, noise: EvalConfig | None, training: bool = False
    ) -> "Environments":
        """Make N games; see `Simulator.make`."""
        from gymnasium.vector import AutoresetMode

        from repaint_cli.envs.starcraft.engines import engine_of
        from repaint_cli.envs.starcraft.env import StarCraftVectorEnv

        return StarCraftVectorEnv(
            engine_of(self, n_envs), n_envs, layers=self.layers,
            autoreset_mode=AutoresetMode.DISABLED if one_episode else AutoresetMode.NEXT_STEP,
        )  # fmt: skip

    def longest_episode(self) -> int:
        """Return the time limit, in steps; that of the game itself may be less than its map's."""
        one_process = self.engine == "pysc2" and self.game_process == "one"
        return -(-longest(self.spec, one_process) // LOOPS_PER_STEP)

    def settled(self) -> Self:
        """Return the settings with the values that follow from the map; see `Simulator.settled`."""
        spec = self.spec
        sizes = (
            {"map_size": round(spec.region.right - spec.region.left)}
            if self.map == LARGE_MAP
            else {}
        )
        camera = "map" if spec.camera == own_camera(self) else self.camera
        settled = {
            "minutes": spec.minutes, "zerglings": spec.zerglings or None, "camera": camera,
        }  # fmt: skip
        return self.model_copy(update=settled | sizes)

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
        return env | {"map_file": str(folder / expanduser(name))} if isinstance(name, str) else env

    def files(self) -> dict[str, Path]:
        """Return the map's file, if it is the user's."""
        return {"map_file": Path(self.map_file)} if self.map_file else {}

    def beside(self, engine: str) -> list[str]:
        """Play a build order in our simulator and in another engine; see `Simulator.beside`."""
        from repaint_cli.envs.starcraft.engines import side_by_side

        return side_by_side(self, engine)

    # How episodes went

    @property
    def score_episodes(self) -> int:
        """Of our simulator, or of the game itself, whose games all play at once."""
        return 20 if self.engine == "mini" else FEW_GAMES

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
