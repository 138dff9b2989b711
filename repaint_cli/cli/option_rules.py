"""The table of options: what typer cannot express of an option, and what follows from it.

A command's options are a named tuple, the table. A field is a row: an option's name, type, default,
and in its annotation typer's part (metavar, heading, sentence) and a `Rule`.
"""

import functools
import inspect
from collections.abc import Callable, Collection, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from repaint_cli.errors import UsageError
from repaint_cli.tasks.methods import ALGORITHMS, METHODS

if TYPE_CHECKING:
    import typer

    from repaint_cli.tasks.card import TaskCard

Options = TypeVar("Options")

TAUGHT = frozenset(name for name, method in METHODS.items() if method.needs_teacher)
KICKSTART = frozenset(name for name, method in METHODS.items() if method.kickstart)
INSTANCE = frozenset(name for name, method in METHODS.items() if method.instance)
ALTERNATING = frozenset(name for name, method in METHODS.items() if method.alternates)


class Condition(NamedTuple):
    """What must hold where an option is given, of the other options or of the task's card."""

    holds: Callable[[Any], object]
    otherwise: str
    """The error's text; `{option}` is the option, `{other}` what it was checked against."""

    def check(self, name: str, other: object) -> None:
        """Check that it holds.

        Raises:
            UsageError: the condition does not hold.
        """
        if not self.holds(other):
            raise UsageError(self.otherwise.format(option=flag(name), other=other))


class Rule(NamedTuple):
    """What an option stands for, and with which others it may be used."""

    setting: str | Callable[[Any], list[str]] = ""
    """The card's `section.key` that it sets, or a function from its value to settings."""
    q_learning: str = ""
    """The `section.key` that it sets with Q-learning, where that is another."""
    methods: Collection[str] = tuple(METHODS)
    """Methods that use it."""
    algorithms: Collection[str] = tuple(ALGORITHMS)
    """Algorithms that use it."""
    options: Condition | None = None
    """What must hold of the other options."""
    card: Condition | None = None
    """What must hold of the card, unless the option is "auto" or the algorithm Q-learning."""
    resumable: bool = False
    """Whether it may be used with --resume: it does not change the run."""

    def settings(self, value: object, algorithm: str) -> list[str]:
        """Return what the option sets on the card, as `section.key=value`.

        Raises:
            UsageError: the value is malformed.
        """
        setting = self.setting
        if self.q_learning and algorithm == "q-learning":
            setting = self.q_learning
        if callable(setting):
            return setting(value)
        return [f"{setting}={value}"] if setting else []


def flag(name: str) -> str:
    """Return an option as it is typed."""
    return f"--{name.replace('_', '-')}"


def parsed_into(
    record: Callable[..., Options],
) -> Callable[[Callable[[Options], None]], Callable[..., None]]:
    """Return a decorator that lets typer fill a record of options for a command."""

    def decorate(command: Callable[[Options], None]) -> Callable[..., None]:
        @functools.wraps(command)
        def callback(**values: object) -> None:
            command(record(**values))

        callback.__dict__["__signature__"] = inspect.signature(record)  # which typer reads
        return callback

    return decorate


def rules_of(options: NamedTuple) -> Iterator[tuple[str, Rule]]:
    """Yield name and rule of every option of a command."""
    for name, kind in type(options).__annotations__.items():
        parts = getattr(kind, "__metadata__", ())
        yield name, next((part for part in parts if isinstance(part, Rule)), Rule())


def given(options: NamedTuple) -> Iterator[tuple[str, Rule, Any]]:
    """Yield name, rule and value of every option that differs from its default."""
    for name, rule in rules_of(options):
        value = getattr(options, name)
        if value != options._field_defaults.get(name):
            yield name, rule, value


def settings_of(options: NamedTuple, algorithm: str = "ppo") -> list[str]:
    """Return what options set on the card, as `section.key=value`, in the order of the table.

    Raises:
        NotFound: there is no such preset.
        UsageError: an option is malformed.
    """
    return [text for _, rule, value in given(options) for text in rule.settings(value, algorithm)]


def check_method(options: NamedTuple, method: str, algorithm: str) -> None:
    """Check that a method and an algorithm use the options that are given.

    Raises:
        UsageError: an option is about what the method leaves out.
    """
    what = f"method '{method}'" + ("" if algorithm == "ppo" else f" of {algorithm}")
    for name, rule, _ in given(options):
        if method not in rule.methods or algorithm not in rule.algorithms:
            raise UsageError(
                f"expected an option that {what} uses, found "
                f"{flag(name)}; leave it out or choose another --method"
            )


def check_together(options: NamedTuple) -> None:
    """Check that no option is given that needs another one, or excludes it.

    Raises:
        UsageError: such an option is given.
    """
    for name, rule, _ in given(options):
        if rule.options:
            rule.options.check(name, options)


def check_card(options: NamedTuple, card: "TaskCard", algorithm: str) -> None:
    """Check that numbers given as options are not for what the card decides otherwise.

    Raises:
        UsageError: a number would change nothing.
    """
    for name, rule, value in given(options):
        if rule.card and value != "auto" and algorithm == "ppo":
            rule.card.check(name, card)


def is_typed(context: "typer.Context", name: str) -> bool:
    """Return whether an option stands on the command line, even with its default."""
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"


def check_resume(options: NamedTuple, context: "typer.Context") -> None:
    """Check that no option beside --resume changes the run.

    Raises:
        UsageError: an option that changes the run is typed, even with its default.
    """
    for name, rule in rules_of(options):
        if is_typed(context, name) and not rule.resumable:
            raise UsageError(f"a run goes on as it began: leave out {flag(name)} beside --resume")
