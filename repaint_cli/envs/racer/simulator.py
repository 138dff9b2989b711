"""Our racing simulator with its settings, behind the interface of simulators."""

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

from pydantic import Field, field_validator

from repaint_cli.envs.checked_file import CheckedFile
from repaint_cli.envs.racer.actions import check_actions
from repaint_cli.envs.racer.mirror import symmetries_of, unpaired_action
from repaint_cli.envs.racer.names import BOT_RECORDS, BOT_TERMS, RECORDS, TERMS
from repaint_cli.envs.simulator import Simulator
from repaint_cli.errors import CardError, RepaintError
from repaint_cli.settings import EvalConfig
from repaint_cli.symmetry import Symmetry

if TYPE_CHECKING:
    from repaint_cli.envs.episodes import Column, Episodes
    from repaint_cli.envs.logs import LogFormat
    from repaint_cli.envs.racer.paths import RacerPaths
    from repaint_cli.envs.reward_functions import RewardFunctions
    from repaint_cli.envs.simulator import Environments


class RacerSimulator(Simulator):
    """Our racing simulator: a car with a camera on a track, alone or among bots."""

    simulator: Literal["racer"]
    """Which simulator this is."""
    track: str = "reinvent-like"
    """A shipped track, by name, or the path of a file of waypoints (`my-track.npy`)."""
    waypoints: Literal["file", "unique"] = "file"
    """How waypoints are numbered for reward functions and logs: as the rows of the track's file, as
    DeepRacer did until March 2026, or without rows that repeat the one before."""
    car: Literal["sim4", "sim5", "ideal"] = "sim4"
    """The car's dynamics: two fits to real logs, or a bicycle without lag."""
    actions: tuple[tuple[float, float], ...] = (
        (-30, 0.5), (-15, 0.5), (0, 0.5), (15, 0.5), (30, 0.5),
        (-30, 1), (-15, 1), (0, 1), (15, 1), (30, 1),
    )  # fmt: skip
    """Steering (degrees, left is positive, at most ±30) and speed (0.1 to 4 m/s) to choose from."""
    sensors: Literal["camera", "camera+lidar", "stereo", "stereo+lidar"] = "camera"
    """What the car sees with: one camera or two, 6 cm apart, and perhaps a lidar looking back."""
    n_bots: int = Field(0, ge=0, le=16)
    """Other cars on the road, which keep a lane at 0.2 m/s and change it every few seconds."""
    crash: Literal["at-fault", "any"] = "at-fault"
    """Which crashes end an episode: those with a bot ahead, as DeepRacer's do, or any."""
    range_min: float = Field(0.12, ge=0, lt=1)
    """What the lidar reads of anything nearer, m."""
    max_steps: int | None = Field(None, gt=0)
    """Time limit of an episode, in steps of 1/15 s; absent: one and a half times what a lap takes
    at the slowest of `actions`, and at least 1,500."""

    @field_validator("track")
    @classmethod
    def _from_any_folder(cls, track: str) -> str:
        """Keep a file's whole path: a run or a teacher is used in other folders too."""
        return str(Path(track).absolute()) if track.endswith(".npy") else track

    @field_validator("actions")
    @classmethod
    def _drive_forwards(
        cls, actions: tuple[tuple[float, float], ...]
    ) -> tuple[tuple[float, float], ...]:
        check_actions(actions)
        return actions

    # Environments

    has_noise: ClassVar[bool] = True

    def make(self, n_envs: int, one_episode: bool, noise: EvalConfig | None) -> "Environments":
        """Make N cars; see `Simulator.make`."""
        from gymnasium.vector import AutoresetMode

        from repaint_cli.envs.racer.env import RacerVectorEnv
        from repaint_cli.envs.racer.sight.noise import Noise
        from repaint_cli.envs.racer.track.files import load_track

        amplitudes = None
        if noise is not None:
            amplitudes = Noise(
                noise.action_noise, noise.brightness_noise, noise.pixel_noise, noise.salt_pepper,
                noise.shift,
            )  # fmt: skip
        try:
            return RacerVectorEnv(
                load_track(self.track, self.waypoints), n_envs, car=self.car, actions=self.actions,
                sensors=self.sensors, n_bots=self.n_bots, crash=self.crash,
                range_min=self.range_min, max_steps=self.longest_episode(), noise=amplitudes,
                autoreset_mode=AutoresetMode.DISABLED if one_episode else AutoresetMode.NEXT_STEP,
            )  # fmt: skip
        except ValueError as error:
            raise CardError(f"[env]: {error}") from error

    def longest_episode(self) -> int:
        """Return the time limit, in steps."""
        from repaint_cli.envs.racer.laps import time_limit

        return self.max_steps or time_limit(self.track, self.actions)

    def settled(self) -> Self:
        """Return the settings with the time limit that follows; see `Simulator.settled`."""
        if self.max_steps is not None:
            return self
        with suppress(RepaintError):  # the track's file is gone
            return self.model_copy(update={"max_steps": self.longest_episode()})
        return self

    def start_options(
        self, n_seeds: int, n_envs: int, iteration: int | None, both_directions: bool
    ) -> dict[str, Any] | None:
        """Return where S × N episodes start; see `Simulator.start_options`.

        Training starts are 0.05 laps after one another, iteration after iteration, as DeepRacer's.
        """
        spacing = 1 / n_envs if iteration is None else 0.05
        first = 0 if iteration is None else (iteration - 1) * n_envs
        places = {"lap_fraction": [(first + n) * spacing % 1 for n in range(n_envs)] * n_seeds}
        if iteration is None and both_directions:
            return places | {"reverse": [n % 2 == 1 for n in range(n_envs)] * n_seeds}
        return places

    @property
    def records(self) -> tuple[str, ...]:
        """What of the infos of a step is worth keeping, by name."""
        return (*RECORDS, *BOT_RECORDS) if self.n_bots else RECORDS

    def notes(self) -> list[str]:
        """Return what was mended in the track's file; see `Simulator.notes`."""
        from repaint_cli.envs.racer.laps import notes_on

        return notes_on(self.track)

    def doubts(self) -> list[str]:
        """Return actions beyond the car, and laps beyond the limit; see `Simulator.doubts`."""
        from repaint_cli.envs.racer.laps import doubts_about

        return doubts_about(self.track, self.actions, self.longest_episode())

    # The task

    @property
    def platform(self) -> str:
        """The paper's single-car or multi-car racing."""
        return "multi-car" if self.n_bots else "single-car"

    @property
    def choices(self) -> tuple[tuple[float, float], ...]:
        """The actions."""
        return self.actions

    @property
    def reward_terms(self) -> frozenset[str]:
        """All terms that it can pay."""
        return TERMS | BOT_TERMS if self.n_bots else TERMS

    takes_symmetry: ClassVar[bool] = False

    def symmetries(self) -> tuple[Symmetry, ...]:
        """Return the reflection from left to right, where each action has a mirror image."""
        return symmetries_of(self.actions, self.sensors)

    def why_no_symmetry(self) -> str | None:
        """Return which action has no mirror image; see `Simulator.why_no_symmetry`."""
        return unpaired_action(self.actions)

    # Files and code that a card brings along

    @classmethod
    def resolve_files(cls, env: dict[str, Any], folder: Path) -> dict[str, Any]:
        """Return [env] with the track beside the card, and the settings of its `model_metadata`.

        The values of the card override those of its file. See `Simulator.resolve_files`.
        """
        from repaint_cli.envs.racer.deepracer.model_files import read_model_metadata

        env = dict(env)
        if str(env.get("track", "")).endswith(".npy"):
            env["track"] = str(folder / env["track"])
        if isinstance(env.get("model_metadata"), str):
            return read_model_metadata(folder / env.pop("model_metadata")) | env
        return env

    def files(self) -> dict[str, Path]:
        """Return the track's file, if it is the user's."""
        return {"track": Path(self.track)} if self.track.endswith(".npy") else {}

    @property
    def reward_functions(self) -> "RewardFunctions":
        """DeepRacer's reward functions."""
        from repaint_cli.envs.racer.reward_functions import RacerRewardFunctions

        return RacerRewardFunctions(self)

    @classmethod
    def check_file(cls, name: str) -> CheckedFile | None:
        """Check a file of waypoints; see `Simulator.check_file`."""
        if not name.endswith(".npy"):
            return None
        from repaint_cli.envs.racer.track.map import check_track

        return check_track(name)

    # How episodes went

    score_episodes: ClassVar[int] = 20

    def columns(self, episodes: "Episodes", s: int) -> "list[Column]":
        """Return progress, laps, their times and crashes; see `Simulator.columns`."""
        from repaint_cli.envs.racer.outcomes import columns

        return columns(episodes, s)

    def outcomes(self, episodes: "Episodes") -> dict[str, Any]:
        """Return progress (%), lap times (s) and how episodes ended, as JSON."""
        from repaint_cli.envs.racer.outcomes import outcomes

        return outcomes(episodes)

    # Paths, films, logs

    @property
    def place(self) -> str:
        """The track."""
        return self.track

    @property
    def paths(self) -> "RacerPaths":
        """The cars' paths."""
        from repaint_cli.envs.racer.paths import RacerPaths

        return RacerPaths(self.track)

    filmed_episodes: ClassVar[int] = 1
    films_observations: ClassVar[bool] = True

    def film(self, episodes: "Episodes", path: Path, title: str, n_episodes: int) -> None:
        """Film the track beside what the camera sees; see `Simulator.film`."""
        from repaint_cli.envs.racer.figures import film

        film(self, episodes, path, title, n_episodes)

    @property
    def logs(self) -> "LogFormat":
        """DeepRacer's logs."""
        from repaint_cli.envs.racer.deepracer.logs import DeepRacerLogs

        return DeepRacerLogs(self)
