"""A card as TOML: whole, to be read again as the same card; with a sentence for each setting."""

import json
import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from repaint_cli.settings import Settings

if TYPE_CHECKING:
    from repaint_cli.tasks.card import TaskCard

WIDTH = 80
"""Of lines with sentences, in characters."""


def to_toml(card: "TaskCard") -> str:
    """Write a card as TOML; settings that are absent stay absent."""
    data = card.model_dump(exclude_none=True, exclude={"name"})
    top = [line(key, value) for key, value in data.items() if not isinstance(value, dict)]
    for section, settings in data.items():
        if isinstance(settings, dict):
            top += ["", f"[{section}]"] + [line(k, v) for k, v in settings.items()]
    return "\n".join(top) + "\n"


def explained(card: "TaskCard") -> Iterator[str]:
    """Yield the lines of a card as TOML, with what each setting means before it.

    A setting that is absent stands in a comment.
    """
    yield from _comment(f"{card.name}, with every setting; a card of your own ends in .toml")
    yield line("summary", card.summary)
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
            yield from _setting(key, value, sentences)


def _setting(key: str, value: Any, sentences: Mapping[str, str]) -> Iterator[str]:
    if key in sentences:
        yield from _comment(sentences[key])
    if value is None:
        yield f"# {key_text(key)} is absent"
    elif len(text := line(key, value)) <= WIDTH or not isinstance(value, tuple | list):
        yield text
    else:
        yield f"{key_text(key)} = ["
        yield from _lines_of([f"{_value(part)}," for part in value])
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


def line(key: str, value: Any) -> str:
    """Return a setting as TOML writes it."""
    return f"{key_text(key)} = {_value(value)}"


def key_text(name: str) -> str:
    """Return a key as TOML writes it."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _value(name)


def _value(value: Any) -> str:
    """Write a value: JSON's words, numbers and texts are TOML's too."""
    if isinstance(value, dict):
        pairs = [line(k, v) for k, v in value.items() if v is not None]
        return f"{{ {', '.join(pairs)} }}" if pairs else "{}"
    if isinstance(value, tuple | list):
        return "[" + ", ".join(_value(part) for part in value) + "]"
    return "".join(map(_escaped, json.dumps(value, ensure_ascii=False)))


def _escaped(letter: str) -> str:
    """Spell out a letter that a terminal would obey, in a way that TOML reads."""
    if letter.isprintable():
        return letter
    return f"\\u{ord(letter):04x}" if ord(letter) < 2**16 else f"\\U{ord(letter):08x}"
