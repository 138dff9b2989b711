"""Sets of choices with a name: `--preset` and `--auto`."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from repaint_cli.errors import NotFound, UsageError
from repaint_cli.files.toml import toml_value
from repaint_cli.tasks.methods import METHODS, method_for
from repaint_cli.tasks.paper import coach_numbers, paper_numbers

if TYPE_CHECKING:
    from repaint_cli.tasks.card import TaskCard

PRESETS: dict[str, Callable[["TaskCard"], dict[str, Any]]] = {
    "paper": paper_numbers,
    "coach": lambda card: paper_numbers(card) | coach_numbers(card),
}
"""`paper`: the numbers and choices of the paper's text. `coach`: the same, and where the text is
silent or its framework did otherwise, what RL Coach did, to approach the paper's own baseline."""

ENDLESS = 1_000_000
"""K of a transfer whose end is measured."""

AUTOMATIC = {
    "transfer.start=auto": (
        "transfer.start",
        "transfer.kickstart_coef",
        "transfer.representation",
        "transfer.instance",
        "select.rule",
        "select.threshold",
    ),
    "transfer.warm_start_min_std=0.37": (
        "transfer.warm_start_min_std",
        "transfer.warm_start_log_std",
    ),
    "transfer.distill_epochs=40": ("transfer.distill_epochs",),
    "transfer.phases=auto": ("transfer.phases", "transfer.representation", "transfer.instance"),
    "transfer.kickstart_schedule=auto": ("transfer.kickstart_schedule", "transfer.kickstart_coef"),
    "select.rule=auto": ("select.rule", "select.threshold"),
    f"transfer.iterations={ENDLESS}": ("transfer.iterations",),
}
"""Settings with which start, ratio, β, ζ and the end of the transfer are measured, teachers are
distilled, and students explore whatever they start from, as `choose-reacher-spread` chose it; one
of those behind them decides it by hand."""


SAYING_HOW = ("transfer.", "select.", "ppo.objective")
"""Settings that say how a teacher is to be used."""

HOW_MUCH = ("transfer.teacher_episodes",)
"""Those that do not, of the same names."""


def with_preset(card: "TaskCard", name: str | None) -> "TaskCard":
    """Return a card with a preset's numbers, or as it is without a name.

    Raises:
        NotFound: there is no such preset.
    """
    if name is None:
        return card
    if name not in PRESETS:
        raise NotFound.named("preset", name, PRESETS, "repaint transfer --help")
    numbers = PRESETS[name](card)
    return card.with_settings([f"{key}={toml_value(value)}" for key, value in numbers.items()])


def says_how(settings: Sequence[str], *choices: object) -> bool:
    """Return whether something says how a teacher is to be used.

    Args:
        settings: those that were made by hand, as `section.key=value`.
        choices: what else says it where it is given: a method, an algorithm, a preset, a teacher
            for instances.
    """
    return any(choices) or any(
        setting.startswith(SAYING_HOW) and not setting.startswith(HOW_MUCH) for setting in settings
    )


def automatic(
    card: "TaskCard", settings: Sequence[str], algorithm: str, method: str | None
) -> "TaskCard":
    """Return a card with those settings of `AUTOMATIC` that are left to be measured.

    Args:
        card: the target task's, with its settings.
        settings: those that were made by hand, as `section.key=value`.
        algorithm: its name.
        method: its name, the algorithm's default where absent.

    Raises:
        NotFound: there is no such algorithm or method.
        UsageError: the method has none of these.
    """
    name = method_for(algorithm, method)
    if not (METHODS[name].kickstart and METHODS[name].alternates):
        raise UsageError(f"expected method 'repaint' to be automatic, found '{name}'")
    by_hand = {setting.partition("=")[0] for setting in settings}
    if card.net.shared:  # where no policy moves alone
        by_hand.add("transfer.distill_epochs")
    return card.with_settings(
        [text for text, deciding in AUTOMATIC.items() if not by_hand.intersection(deciding)]
    )
