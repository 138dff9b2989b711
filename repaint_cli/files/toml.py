"""Values, keys and lines of TOML, as we write them."""

import json
import re
from collections.abc import Mapping
from typing import Any


def toml_line(key: str, value: Any) -> str:
    """Return a setting as TOML writes it."""
    return f"{toml_key(key)} = {toml_value(value)}"


def toml_key(name: str) -> str:
    """Return a key as TOML writes it."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else toml_value(name)


def toml_value(value: Any) -> str:
    """Write a value on one line; TOML has no None, which is left out of a table.

    JSON's words, whole numbers and texts are TOML's too.
    """
    if isinstance(value, Mapping):
        pairs = [toml_line(k, v) for k, v in value.items() if v is not None]
        return f"{{ {', '.join(pairs)} }}" if pairs else "{}"
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(toml_value, value))}]"
    if isinstance(value, float):
        return repr(float(value))  # also inf and nan
    return "".join(map(_escaped, json.dumps(value, ensure_ascii=False)))


def _escaped(letter: str) -> str:
    """Spell out a letter that a terminal would obey, in a way that TOML reads."""
    if letter.isprintable():
        return letter
    return f"\\u{ord(letter):04x}" if ord(letter) < 2**16 else f"\\U{ord(letter):08x}"
