"""The settings of cards one by one, by `section.key`: their texts, and in which cards differ."""

from collections.abc import Collection, Mapping
from typing import Any

from repaint_cli.files.toml import toml_value
from repaint_cli.tasks.card import TaskCard

ABSENT = "absent"
"""The text of a setting that is None, or that a card does not have."""


def settings_of(card: TaskCard, leave_out: Collection[str] = ()) -> dict[str, Any]:
    """Return a card's settings as JSON has them, but for those of some sections."""
    return {
        f"{section}.{key}": value
        for section, values in card.model_dump(mode="json", exclude=set(leave_out)).items()
        if isinstance(values, Mapping)
        for key, value in values.items()
    }


def differing(*each: Mapping[str, Any]) -> list[str]:
    """Return the names of the settings that are not the same in all, as they come."""
    names = dict.fromkeys(name for settings in each for name in settings)
    first, *others = each
    return [name for name in names if any(own.get(name) != first.get(name) for own in others)]


def setting_text(settings: Mapping[str, Any], name: str, longest: int | None = None) -> str:
    """Return a setting for people, a text without quotes, cut to so many letters."""
    value = settings.get(name)
    if value is None:
        return ABSENT
    text = value if isinstance(value, str) else toml_value(value)
    return text if longest is None or len(text) <= longest else f"{text[: longest - 1]}…"
