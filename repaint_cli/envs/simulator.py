"""The simulators a task may be of, as a card's [env] section names and sets them.

Nothing here imports a simulator before it is needed.
"""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field, field_validator

from repaint_cli.errors import CardError
from repaint_cli.settings import EvalConfig, Settings

if TYPE_CHECKING:
    from gymnasium.vector import VectorEnv


class GymEnv(Settings):
    """An environment of Gymnasium, by id."""

    simulator: Literal["gymnasium"]
    """Which simulator this is."""
    id: str
    """The environment's id, as in `gymnasium.make`."""
    backend: Literal["auto", "envpool", "gymnasium"] = "auto"
    """Who steps it: EnvPool where installed and checked to be equal, else Gymnasium."""
    kwargs: dict[str, bool | int | float | str] = Field(default_factory=dict)
    """Arguments for the environment."""

    @field_validator("kwargs")
    @classmethod
    def _of_the_environment(cls, kwargs: dict[str, Any]) -> dict[str, Any]:
        """Refuse what Gymnasium itself would take: windows, other time limits, wrappers."""
        for name in ("render_mode", "max_episode_steps", "num_envs", "disable_env_checker"):
            if name in kwargs:
                raise ValueError(f"expected arguments of the environment itself, found {name}")
        return kwargs

    @property
    def actions(self) -> None:
        """What to choose from: the environment itself says."""

    @property
    def records(self) -> tuple[str, ...]:
        """What else of a step is worth remembering, by name: nothing that all of them know."""
        return ()

    def make(
        self, n_envs: int, one_episode: bool, noise: EvalConfig | None
    ) -> "VectorEnv[Any, Any, Any]":
        """Make N copies; see `TaskCard.make_env`. They know no noise.

        Raises:
            CardError: Gymnasium does not know the id, or refuses the arguments.
        """
        from repaint_cli.envs.gymnasium.vector import make_gym

        return make_gym(self.id, n_envs, self.kwargs, self.backend)

    def start_options(
        self, n_seeds: int, n_envs: int, iteration: int | None, both_directions: bool
    ) -> dict[str, Any] | None:
        """Return None: the environment decides where its episodes start."""
        return None

    def longest_episode(self) -> int:
        """Return the time limit, in steps.

        Raises:
            CardError: there is no such environment, or it has no limit.
        """
        import gymnasium

        module, _, name = self.id.rpartition(":")  # where it is registered, and its name
        try:
            if module:
                import_module(module)
            limit = gymnasium.spec(name).max_episode_steps
        except (gymnasium.error.Error, ImportError) as error:
            raise CardError(f"gymnasium has no environment '{self.id}': {error}") from error
        if limit is None:
            raise CardError(
                f"'{self.id}' has no time limit, so an evaluation might never end; "
                "register it with max_episode_steps"
            )
        return limit


RECORDS = (
    "x", "y", "heading", "speed", "steering", "progress", "lap_time", "wheels_on", "waypoint",
    "status",
)  # fmt: skip
"""What the racer tells of a car after each step."""


class RacerEnv(Settings):
    """Our racing simulator: a car with a camera on a track, alone or among bots."""

    simulator: Literal["racer"]
    """Which simulator this is."""
    track: str = "reinvent-like"
    """A shipped track, by name, or the path of a file of waypoints (`my-track.npy`)."""
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
    max_steps: int = Field(1500, gt=0)
    """Time limit of an episode, in steps of 1/15 s."""

    @field_validator("track")
    @classmethod
    def _found_from_anywhere(cls, track: str) -> str:
        """Keep a file's whole path: a run or a teacher is used in other folders too."""
        return str(Path(track).absolute()) if track.endswith(".npy") else track

    @property
    def records(self) -> tuple[str, ...]:
        """What else of a step is worth remembering, by its name in the infos."""
        return (*RECORDS, "bots", "hit") if self.n_bots else RECORDS

    def make(
        self, n_envs: int, one_episode: bool, noise: EvalConfig | None
    ) -> "VectorEnv[Any, Any, Any]":
        """Make N copies; see `TaskCard.make_env`.

        Raises:
            NotFound: there is no such track.
            CardError: the track's file holds none, or the racer refuses a setting.
        """
        from gymnasium.vector import AutoresetMode

        from repaint_cli.envs.racer.env import RacerVectorEnv
        from repaint_cli.envs.racer.sight.noise import Noise
        from repaint_cli.envs.racer.track.files import load_track

        disturbances = None
        if noise is not None:
            disturbances = Noise(
                noise.action_noise, noise.brightness_noise, noise.pixel_noise, noise.salt_pepper,
                noise.shift,
            )  # fmt: skip
        try:
            return RacerVectorEnv(
                load_track(self.track), n_envs, car=self.car, actions=self.actions,
                sensors=self.sensors, n_bots=self.n_bots, crash=self.crash,
                range_min=self.range_min, max_steps=self.max_steps, noise=disturbances,
                autoreset_mode=AutoresetMode.DISABLED if one_episode else AutoresetMode.NEXT_STEP,
            )  # fmt: skip
        except ValueError as error:
            raise CardError(f"[env]: {error}") from error

    def start_options(
        self, n_seeds: int, n_envs: int, iteration: int | None, both_directions: bool
    ) -> dict[str, Any] | None:
        """Return where S × N episodes start; see `TaskCard.start_options`."""
        spacing = 1 / n_envs if iteration is None else 0.05
        first = 0 if iteration is None else (iteration - 1) * n_envs
        places = {"lap_fraction": [(first + n) * spacing % 1 for n in range(n_envs)] * n_seeds}
        if iteration is None and both_directions:
            return places | {"reverse": [n % 2 == 1 for n in range(n_envs)] * n_seeds}
        return places

    def longest_episode(self) -> int:
        """Return the time limit, in steps."""
        return self.max_steps
