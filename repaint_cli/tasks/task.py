"""A task is a card: an environment, the weights w of its reward terms φ, what else differs.

Nothing here imports a simulator before it is needed, so that listing and comparing tasks is quick.
"""

import tomllib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field, ValidationError, field_validator, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from repaint_cli.envs.simulator import GymEnv, RacerEnv
from repaint_cli.errors import CardError, NotFound
from repaint_cli.policies.architecture import NetConfig
from repaint_cli.settings import (
    EvalConfig,
    PPOConfig,
    QLearningConfig,
    SelectConfig,
    Settings,
    TransferConfig,
    first_problem,
)

if TYPE_CHECKING:
    from repaint_cli.envs.reward_terms import RewardTerms


class RewardCode(Settings):
    """A user's own reward function: a file's name and its text."""

    name: str
    """What the file is called."""
    source: str
    """Python, with `def reward_function(params)`."""


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
    reward_code: RewardCode | None = None
    """In place of weighed terms: a function of the racer's `params`, the one term "function"."""
    net: NetConfig = Field(default_factory=NetConfig)
    """The networks."""
    ppo: PPOConfig = Field(default_factory=PPOConfig)
    """Training."""
    transfer: TransferConfig = Field(default_factory=TransferConfig)
    """The teacher's part."""
    select: SelectConfig = Field(default_factory=SelectConfig)
    """Experience selection."""
    q_learning: QLearningConfig = Field(default_factory=QLearningConfig)
    """Q-learning in place of PPO."""
    eval: EvalConfig = Field(default_factory=EvalConfig)
    """Evaluation."""

    @field_validator("name")
    @classmethod
    def _of_one_folder(cls, name: str) -> str:
        """Refuse names that lead elsewhere: the folder of a task's runs is called so, too."""
        if not name.isprintable() or set(name) & set("/\\[]") or name in ("", ".", ".."):
            raise ValueError("expected a name that a folder can have, without / \\ [ ]")
        return name

    @field_validator("reward")
    @classmethod
    def _some_weight(cls, weights: dict[str, float]) -> dict[str, float]:
        if not any(weights.values()):
            raise ValueError("at least one weight must differ from 0")
        return weights

    @field_validator("transfer")
    @classmethod
    def _method_decides(cls, transfer: TransferConfig) -> TransferConfig:
        """Refuse joint updates on a card: which parts of REPAINT are on is the method's matter."""
        if transfer.joint:
            found = PydanticCustomError("joint", "expected False; use --method repaint-joint")
            where = InitErrorDetails(type=found, loc=("joint",), input=True)
            raise ValidationError.from_exception_data(cls.__name__, [where])
        return transfer

    @model_validator(mode="after")
    def _code_is_for_the_racer(self) -> "TaskCard":
        if self.reward_code and self.env.simulator != "racer":
            raise ValueError("a reward function needs the racer's params: env.simulator = 'racer'")
        if self.reward_code and list(self.reward) != ["function"]:
            raise ValueError("a reward function stands alone: leave the other terms out")
        return self

    @property
    def automatic(self) -> bool:
        """Whether something of the transfer is decided by what is measured."""
        return "auto" in (
            self.transfer.kickstart_schedule, self.transfer.phases, self.select.rule
        )  # fmt: skip

    @classmethod
    def parse(cls, data: Mapping[str, Any], where: str) -> "TaskCard":
        """Check a card's data.

        Raises:
            CardError: naming the first key that is unknown, absent or out of range.
        """
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            raise CardError(f"{where}: {first_problem(error)}") from error

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
        from repaint_cli.envs.reward_terms import RewardTerms

        amplitudes = self.eval if noise else None
        env = self.env.make(n_envs, one_episode, amplitudes)
        if self.reward_code:
            from repaint_cli.envs.racer.deepracer.reward_file import RewardFile

            env = RewardFile(env, self.reward_code.name, self.reward_code.source)
        return RewardTerms(env, self.reward)

    def start_options(
        self, n_seeds: int, n_envs: int, iteration: int | None
    ) -> dict[str, Any] | None:
        """Return where S × N episodes start, for `reset`; None where the environment decides.

        Racing episodes start 0.05 laps after one another, iteration after iteration, as DeepRacer's
        do; without an iteration (evaluation) the N episodes are spread evenly over the lap.
        """
        return self.env.start_options(n_seeds, n_envs, iteration, self.eval.both_directions)

    def check_rollout(self) -> None:
        """Check that episodes end, and that every environment of a rollout finishes one.

        Raises:
            CardError: an episode, or with fresh environments each iteration all of them, would not.
        """
        need = self.env.longest_episode() + 1
        steps, envs = self.ppo.n_steps, self.ppo.n_envs
        if self.ppo.n_episodes is None and steps and steps < envs * need:
            advice = f"n_envs={steps // need}" if steps >= need else f"n_steps={envs * need}"
            raise CardError(
                f"expected ppo.n_steps / ppo.n_envs of at least {need} (the longest episode + 1), "
                f"found {steps} / {envs}; try --set ppo.{advice}"
            )


def _toml_value(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text
