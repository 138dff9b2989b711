"""A card as TOML: whole, to be read again as the same card; with a sentence for each setting."""

import textwrap
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from repaint_cli.files.toml import toml_key, toml_line, toml_value
from repaint_cli.settings import Settings
from repaint_cli.tasks.card_settings import ABSENT

if TYPE_CHECKING:
    from repaint_cli.tasks.card import TaskCard

WIDTH = 80
"""Of lines with sentences, in characters."""


def to_toml(card: "TaskCard") -> str:
    """Write a card as TOML; settings that are absent stay absent."""
    data = card.model_dump(exclude_none=True, exclude={"name"})
    top = [toml_line(key, value) for key, value in data.items() if not isinstance(value, dict)]
    for section, settings in data.items():
        if isinstance(settings, dict):
            top += ["", f"[{section}]"] + [toml_line(k, v) for k, v in settings.items()]
    return "\n".join(top) + "\n"


def explained(card: "TaskCard", sources: Mapping[str, str] | None = None) -> Iterator[str]:
    """Yield the lines of a card as TOML, with what each setting means before it.

    A setting that is absent stands in a comment. `sources` say whose number each setting is, by
    `section.key`; they stand behind it.
    """
    yield from _comment(f"{card.name}, with every setting; a card of your own ends in .toml")
    yield toml_line("summary", card.summary)
    meaning = type(card).sentences()
    for section, settings in card.model_dump(exclude={"name", "summary"}).items():
        if settings is None:  # no reward function
            continue
        yield ""
        head = f"[{section}]  # {meaning[section]}"
        yield from [head] if len(head) <= WIDTH else [f"[{section}]", *_comment(meaning[section])]
        part = getattr(card, section)
        sentences = type(part).sentences() if isinstance(part, Settings) else {}
        for key, value in settings.items():
            *lines, last = _setting(key, value, sentences)
            yield from lines
            source = (sources or {}).get(f"{section}.{key}")
            yield f"{last}  # {source}" if source else last


def _setting(key: str, value: Any, sentences: Mapping[str, str]) -> Iterator[str]:
    if key in sentences:
        yield from _comment(sentences[key])
    if value is None:
        yield f"# {toml_key(key)} is {ABSENT}"
    elif len(text := toml_line(key, value)) <= WIDTH or not isinstance(value, tuple | list):
        yield text
    else:
        yield f"{toml_key(key)} = ["
        yield from _lines_of([f"{toml_value(part)}," for part in value])
        yield "]"


def _lines_of(parts: Iterable[str]) -> Iterator[str]:
    """Yield parts of a list, as many on a line as there is room for."""
    line = "   "
    for part in parts:
        if line.strip() and len(f"{line} {part}") > WIDTH:
            yield line
            line = "   "
        line += f" {part}"
    yield line


def _comment(text: str) -> list[str]:
    words = " ".join(text.split())
    return textwrap.wrap(
        words, WIDTH, initial_indent="# ", subsequent_indent="# ", break_on_hyphens=False
    )
