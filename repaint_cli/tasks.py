"""A task is a card: an environment, the weights w of its reward terms φ, what else differs.

Nothing here imports a simulator before it is needed, so that listing and comparing tasks is quick.
"""

import tomllib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, ValidationError, field_validator

from repaint_cli.config import (
    EvalConfig,
    NetConfig,
    PPOConfig,
    SelectConfig,
    Settings,
    TransferConfig,
)
from repaint_cli.errors import CardError, NotFound
from repaint_cli.paths import shipped

if TYPE_CHECKING:
    from repaint_cli.envs.terms import RewardTerms


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


class RacerEnv(Settings):
    """Our racing simulator: a car with a camera on a closed track, alone or among bots."""

    simulator: Literal["racer"]
    """Which simulator this is."""
    track: str = "reinvent-like"
    """A shipped track, by name."""
    car: Literal["sim4", "sim5", "ideal"] = "sim4"
    """The car's dynamics: two fits to real logs, or a bicycle without lag."""
    sensors: Literal["camera", "stereo", "stereo+lidar"] = "camera"
    """What the car sees with: one camera, two 6 cm apart, or these and a lidar looking back."""
    n_bots: int = Field(0, ge=0, le=16)
    """Other cars on the road, which keep a lane at 0.2 m/s and change it every few seconds."""
    crash: Literal["at-fault", "any"] = "at-fault"
    """Which crashes end an episode: those with a bot ahead, as DeepRacer's do, or any."""
    range_min: float = Field(0.12, ge=0, lt=1)
    """What the lidar reads of anything nearer, m."""
    max_steps: int = Field(1500, gt=0)
    """Time limit of an episode, in steps of 1/15 s."""


class TaskCard(Settings):
    """A task: environment, reward weights, and the numbers to train it with."""

    name: str
    """The card's file name without its suffix."""
    summary: str
    """One sentence for people."""
    env: Annotated[GymEnv | RacerEnv, Field(discriminator="simulator")]
    """The simulator and its settings."""
    reward: dict[str, float]
    """Weights w by the names of the terms φ, in multiples of the environment's own coefficients."""
    net: NetConfig = NetConfig()
    """The networks."""
    ppo: PPOConfig = PPOConfig()
    """Training."""
    transfer: TransferConfig = TransferConfig()
    """The teacher's part."""
    select: SelectConfig = SelectConfig()
    """Experience selection."""
    eval: EvalConfig = EvalConfig()
    """Evaluation."""

    @field_validator("reward")
    @classmethod
    def _some_weight(cls, weights: dict[str, float]) -> dict[str, float]:
        if not any(weights.values()):
            raise ValueError("at least one weight must differ from 0")
        return weights

    @classmethod
    def parse(cls, data: Mapping[str, Any], where: str) -> "TaskCard":
        """Check a card's data.

        Raises:
            CardError: naming the first key that is unknown, absent or out of range.
        """
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            raise CardError(f"{where}: {_first_problem(error)}") from error

    def with_settings(self, settings: list[str]) -> "TaskCard":
        """Return the card with `section.key=value` settings applied; values are TOML or words.

        Raises:
            CardError: a setting is malformed or out of range.
            NotFound: there is no such section or key.
        """
        data = self.model_dump()
        for setting in settings:
            path, found, value = setting.partition("=")
            if not found or path.count(".") != 1:
                raise CardError(f"expected --set section.key=value, found '{setting}'")
            section, key = path.split(".")
            sections = [name for name, part in data.items() if isinstance(part, dict)]
            where = "repaint tasks show " + self.name
            if section not in sections:
                raise NotFound.named("section", section, sections, where)
            if section != "reward" and key not in data[section]:
                raise NotFound.named(
                    "setting", path, [f"{section}.{k}" for k in data[section]], where
                )
            data[section][key] = _toml_value(value)
        return TaskCard.parse(data, f"task '{self.name}'") if settings else self

    def make_env(
        self, n_envs: int, *, one_episode: bool = False, noise: bool = False
    ) -> "RewardTerms":
        """Make N copies of the task's environment; its rewards are w·φ.

        Args:
            n_envs: N.
            one_episode: whether environments may stop for good after their first episode.
            noise: whether to add the paper's small evaluation noise, where the simulator knows it.

        Raises:
            CardError: the environment cannot be made.
        """
        from repaint_cli.envs.terms import RewardTerms

        amplitudes = self.eval if noise else None
        return RewardTerms(_make_env(self.env, n_envs, one_episode, amplitudes), self.reward)

    def start_options(
        self, n_seeds: int, n_envs: int, iteration: int | None
    ) -> dict[str, Any] | None:
        """Return where S × N episodes start, for `reset`; None where the environment decides.

        Racing episodes start 0.05 laps after one another, iteration after iteration, as DeepRacer's
        do; without an iteration (evaluation) the N episodes are spread evenly over the lap.
        """
        if isinstance(self.env, GymEnv):
            return None
        spacing = 1 / n_envs if iteration is None else 0.05
        first = 0 if iteration is None else (iteration - 1) * n_envs
        places = {"lap_fraction": [(first + n) * spacing % 1 for n in range(n_envs)] * n_seeds}
        if iteration is None and self.eval.both_directions:
            return places | {"reverse": [n % 2 == 1 for n in range(n_envs)] * n_seeds}
        return places

    def check_rollout(self) -> None:
        """Check that episodes end, and that every environment of a rollout finishes one.

        Raises:
            CardError: an episode, or with fresh environments each iteration all of them, would not.
        """
        need = self._longest_episode() + 1
        steps, envs = self.ppo.n_steps, self.ppo.n_envs
        if self.ppo.n_episodes is None and steps and steps < envs * need:
            advice = f"n_envs={steps // need}" if steps >= need else f"n_steps={envs * need}"
            raise CardError(
                f"expected ppo.n_steps / ppo.n_envs of at least {need} (the longest episode + 1), "
                f"found {steps} / {envs}; try --set ppo.{advice}"
            )

    def _longest_episode(self) -> int:
        if isinstance(self.env, RacerEnv):
            return self.env.max_steps
        import gymnasium

        try:
            limit = gymnasium.spec(self.env.id).max_episode_steps
        except (gymnasium.error.Error, ImportError) as error:
            raise CardError(f"gymnasium has no environment '{self.env.id}': {error}") from error
        if limit is None:
            raise CardError(
                f"'{self.env.id}' has no time limit, so an evaluation might never end; "
                "register it with max_episode_steps"
            )
        return limit


def _make_env(
    env: GymEnv | RacerEnv, n_envs: int, one_episode: bool, noise: EvalConfig | None
) -> Any:
    if isinstance(env, GymEnv):
        from repaint_cli.envs.gym import make_gym

        return make_gym(env.id, n_envs, env.kwargs, env.backend)
    from gymnasium.vector import AutoresetMode

    from repaint_cli.envs.racer import Noise, RacerVectorEnv

    disturbances = None
    if noise is not None:
        disturbances = Noise(
            noise.action_noise, noise.brightness_noise, noise.pixel_noise, noise.salt_pepper,
            noise.shift,
        )  # fmt: skip
    mode = AutoresetMode.DISABLED if one_episode else AutoresetMode.NEXT_STEP
    return RacerVectorEnv(
        load_track(env.track),
        n_envs,
        car=env.car,
        sensors=env.sensors,
        n_bots=env.n_bots,
        crash=env.crash,
        range_min=env.range_min,
        max_steps=env.max_steps,
        noise=disturbances,
        autoreset_mode=mode,
    )


def load_track(name: str) -> Any:
    """Read a shipped track.

    Raises:
        NotFound: there is no track of this name.
    """
    import numpy as np

    from repaint_cli.envs.racer.track import Track

    folder = shipped("tasks") / "racer" / "tracks"
    known = sorted(path.stem for path in folder.glob("*.npy"))
    if name not in known:
        raise NotFound.named("track", name, known, "repaint tasks list")
    return Track.from_waypoints(np.load(folder / f"{name}.npy"), name)


def _toml_value(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def _first_problem(error: ValidationError) -> str:
    problem = error.errors()[0]
    loc = [str(part) for part in problem["loc"]]
    if loc[:1] == ["env"]:
        del loc[1:2]  # the simulator, which pydantic names too
    where = ".".join(loc)
    if problem["type"] == "extra_forbidden":
        return f"unknown key '{where}'"
    found = "" if problem["type"] == "missing" else f", found {problem['input']!r}"
    wanted = problem["msg"].removeprefix("Value error, ").replace("Input should be", "expected")
    return f"{where}: {wanted}{found}"
