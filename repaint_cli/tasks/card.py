"""A card is a task with a recipe to learn it, and a name: what people write, and files keep."""

import tomllib
from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Self

from pydantic import ValidationError, field_validator, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from repaint_cli.envs.registry import simulator_class
from repaint_cli.errors import CardError, NotFound, UsageError
from repaint_cli.settings import UNKNOWN_KEY, Settings, first_problem
from repaint_cli.tasks.recipe import Recipe
from repaint_cli.tasks.setting_names import did_you_mean, same_settings
from repaint_cli.tasks.symmetry import SymmetryConfig
from repaint_cli.tasks.task import FUNCTION, SCALE, Task
from repaint_cli.tasks.transfer_settings import TransferConfig

if TYPE_CHECKING:
    from repaint_cli.envs.logs import LoggedRun


class Titled(Settings):
    """What a card is called; the last base of a card, whose fields come first in every file."""

    name: str
    """The card's file name without its suffix."""
    summary: str
    """One sentence for people."""

    @field_validator("name")
    @classmethod
    def _of_one_folder(cls, name: str) -> str:
        """Refuse names with path separators: the folder of a task's runs has this name, too."""
        if not name.isprintable() or set(name) & set("/\\[]") or name in ("", ".", ".."):
            raise ValueError("expected a name that a folder can have, without / \\ [ ]")
        return name


class TaskCard(Recipe, Task, Titled):
    """A task, its recipe, its name and a sentence; equal cards are equal in every field."""

    __eq__ = Settings.__eq__
    __hash__ = None  # type: ignore[assignment]

    @field_validator("transfer")
    @classmethod
    def _method_decides(cls, transfer: TransferConfig) -> TransferConfig:
        """Refuse joint updates on a card: the method decides which parts of REPAINT are on."""
        if transfer.joint:
            problem = PydanticCustomError("joint", "expected False; use --method repaint-joint")
            where = InitErrorDetails(type=problem, loc=("joint",), input=True)
            raise ValidationError.from_exception_data(cls.__name__, [where])
        return transfer

    @model_validator(mode="after")
    def _best_is_recorded(self) -> Self:
        if self.eval.best != "return" and "progress" not in self.env.records:
            raise ValueError(
                f"expected eval.best = 'return' but with a racing task, found '{self.eval.best}'"
            )
        return self

    @property
    def task(self) -> Task:
        """The task alone."""
        return Task(
            env=self.env, reward=self.reward, reward_code=self.reward_code, symmetry=self.symmetry
        )

    @property
    def logged(self) -> "LoggedRun":
        """What logs hold of a run on this card."""
        from repaint_cli.envs.logs import LoggedRun

        code, n_convolutions = self.reward_code, len(self.net.conv_torso.layers)
        if code is None:
            return LoggedRun(self.ppo, n_convolutions, None)
        return LoggedRun(self.ppo, n_convolutions, code.source, self.reward.get(FUNCTION, 1.0))

    @classmethod
    def parse(cls, data: Mapping[str, Any], where: str) -> "TaskCard":
        """Check a card's data.

        Raises:
            CardError: a key is unknown, absent or out of range; the message names the first.
        """
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            problem = first_problem(error)
            if problem.startswith(UNKNOWN_KEY):
                problem += did_you_mean(problem.removeprefix(UNKNOWN_KEY).strip("'"), _known(data))
            raise CardError(f"{where}: {problem}") from error

    def with_settings(self, settings: list[str]) -> "TaskCard":
        """Return the card with `section.key=value` settings applied; values are TOML or words.

        Raises:
            UsageError: a setting is not `section.key=value`.
            CardError: a value is out of range.
            NotFound: there is no such section or key.
        """
        data = self.model_dump()
        known = [f"{name}.{key}" for name, part in _sections(data).items() for key in part]
        for setting in settings:
            path, equals, value = setting.partition("=")
            if not equals or path.count(".") != 1:
                hint = did_you_mean(path, known).replace("?", f"={value}?") if equals else ""
                raise UsageError(f"expected --set section.key=value, found '{setting:.200}'{hint}")
            section, key = path.split(".")
            if path == f"reward.{SCALE}" and self.reward_code:
                key = FUNCTION
            if section not in _sections(data) or (section != "reward" and path not in known):
                raise self._no_setting(path, known)
            data[section][key] = _toml_value(value)
        if self.reward_code:  # with its file, which is not dumped
            data["reward_code"] = self.reward_code
        return TaskCard.parse(data, f"task '{self.name}'") if settings else self

    def _no_setting(self, path: str, known: list[str]) -> NotFound:
        """Return the error of a setting that there is not, which names those that are near."""
        section, where = path.partition(".")[0], f"repaint tasks show {self.name}"
        sections = dict.fromkeys(name.partition(".")[0] for name in known)
        if section not in sections and not same_settings(path, known):
            return NotFound.named("section", section, sections, where)
        hint = did_you_mean(path, known) or ";"
        return NotFound(f"unknown setting '{path:.200}'{hint} see: {where}")

    def start_options(
        self, n_seeds: int, n_envs: int, iteration: int | None
    ) -> dict[str, Any] | None:
        """Return where S × N episodes start, for `reset`; None where the environment decides.

        Without an iteration they are those of an evaluation.
        """
        return self.env.start_options(n_seeds, n_envs, iteration, self.eval.both_directions)

    @property
    def continues_episodes(self) -> bool:
        """Whether a rollout goes on where the last one ended; see `ppo.continue_episodes`.

        Raises:
            CardError: the environment does not exist or has no time limit.
        """
        ppo = self.ppo
        if ppo.n_episodes or ppo.n_steps is None or ppo.whole_episodes:
            return False
        if ppo.continue_episodes is None:
            return ppo.n_steps < ppo.n_envs * (self.env.longest_episode() + 1)
        return ppo.continue_episodes

    def check_rollout(self) -> None:
        """Check that episodes end, and that a rollout is long enough.

        Raises:
            CardError: an episode does not end, an environment takes no step, or with fresh
                environments each iteration an episode would never be seen to its end.
        """
        need = self.env.longest_episode() + 1
        steps, envs = self.ppo.n_steps, self.ppo.n_envs
        if self.ppo.n_episodes is not None or not steps:
            return
        if steps < envs:
            raise CardError(
                f"expected ppo.n_steps of at least ppo.n_envs, a step of each environment, found "
                f"{steps} and {envs}; try --set ppo.n_envs={steps}"
            )
        if steps < envs * need and not self.continues_episodes:
            fewer = f"ppo.n_envs={max(1, steps // need)}"
            advice = fewer if steps >= need else f"{fewer} --set ppo.n_steps={need}"
            raise CardError(
                f"expected ppo.n_steps / ppo.n_envs of at least {need} (the longest episode + 1) "
                f"where rollouts begin afresh, found {steps} / {envs}; try --set {advice}"
            )


def _sections(data: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    return {name: part for name, part in data.items() if isinstance(part, Mapping)}


def _known(data: Mapping[str, Any]) -> list[str]:
    """Return the settings that a card may have: of its recipe, symmetry and simulator."""
    recipe = {name: field.default_factory for name, field in Recipe.model_fields.items()}
    kinds: dict[str, Any] = recipe | {"symmetry": SymmetryConfig}
    env = data.get("env")
    with suppress(ValueError):
        kinds["env"] = simulator_class(env.get("simulator") if isinstance(env, Mapping) else None)
    return [
        f"{section}.{key}"
        for section, kind in kinds.items()
        if isinstance(kind, type) and issubclass(kind, Settings)
        for key in kind.model_fields
    ]


def _toml_value(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text
