"""A card is a task with a recipe to learn it, and a name: what people write, and files keep."""

import tomllib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError, field_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from repaint_cli.errors import CardError, NotFound, UsageError
from repaint_cli.settings import Settings, TransferConfig, first_problem
from repaint_cli.tasks.recipe import Recipe
from repaint_cli.tasks.task import Task

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

    @property
    def task(self) -> Task:
        """The task alone."""
        return Task(env=self.env, reward=self.reward, reward_code=self.reward_code)

    @property
    def logged(self) -> "LoggedRun":
        """What logs hold of a run on this card."""
        from repaint_cli.envs.logs import LoggedRun

        source = self.reward_code.source if self.reward_code else None
        return LoggedRun(self.ppo, len(self.net.conv_torso.layers), source)

    @classmethod
    def parse(cls, data: Mapping[str, Any], where: str) -> "TaskCard":
        """Check a card's data.

        Raises:
            CardError: a key is unknown, absent or out of range; the message names the first.
        """
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            raise CardError(f"{where}: {first_problem(error)}") from error

    def with_settings(self, settings: list[str]) -> "TaskCard":
        """Return the card with `section.key=value` settings applied; values are TOML or words.

        Raises:
            UsageError: a setting is not `section.key=value`.
            CardError: a value is out of range.
            NotFound: there is no such section or key.
        """
        data = self.model_dump()
        for setting in settings:
            path, equals, value = setting.partition("=")
            if not equals or path.count(".") != 1:
                raise UsageError(f"expected --set section.key=value, found '{setting}'")
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

    def start_options(
        self, n_seeds: int, n_envs: int, iteration: int | None
    ) -> dict[str, Any] | None:
        """Return where S × N episodes start, for `reset`; None where the environment decides.

        Without an iteration they are those of an evaluation.
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
