"""What a user's module remembers: which of its variables change while its function is called."""

import random
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from hashlib import sha256
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

MOST_PARTS = 100_000
"""Of a variable that are looked at, and how deep they lie within one another."""
DEEPEST = 30


def fingerprints(module: Mapping[str, Any], name: str) -> dict[str, str]:
    """Return a fingerprint of the value of each variable of a module, by its name.

    What a function or a class of its own keeps counts as a part of it. Fingerprints of two moments
    differ where the value has changed; only those of the same module can be compared.

    Args:
        module: its variables.
        name: what its functions and classes say that it is called.
    """
    return {
        key: _Reader(name).read(value) for key, value in module.items() if not key.startswith("__")
    }


class _Reader:
    """Reads a value with all its parts, each object once."""

    def __init__(self, module: str) -> None:
        self._module, self._seen, self._n = module, set[int](), 0
        self._hash = sha256()

    def read(self, value: Any) -> str:
        """Return the fingerprint."""
        self._add(value, 0)
        return self._hash.hexdigest()

    def _add(self, value: Any, depth: int) -> None:
        self._n += 1
        if self._n > MOST_PARTS or depth > DEEPEST:
            return
        self._feed(type(value).__name__)
        if value is None or isinstance(value, bool | int | float | complex | str | bytes):
            self._feed(repr(value))
            return
        if id(value) in self._seen:
            return
        self._seen.add(id(value))
        for part in self._parts(value):
            self._add(part, depth + 1)

    def _parts(self, value: Any) -> list[Any]:
        """Return what a value consists of; of one that is unknown, what it is called."""
        if isinstance(value, ModuleType):
            return [value.__name__]
        if isinstance(value, np.ndarray) and value.dtype != object:
            return [str(value.dtype), str(value.shape), value.tobytes()]
        if isinstance(value, dict):
            return [part for pair in value.items() for part in pair]
        if isinstance(value, list | tuple | deque):
            return [*value]
        if isinstance(value, set | frozenset):
            return sorted(map(repr, value))
        if isinstance(value, FunctionType):
            cells = [cell.cell_contents for cell in value.__closure__ or () if _is_full(cell)]
            return [value.__defaults__, value.__kwdefaults__, vars(value), cells]
        if isinstance(value, type):
            own = vars(value) if value.__module__ == self._module else {}
            return [value.__qualname__, *(own[k] for k in own if not k.startswith("__"))]
        return [*_state(value), type(value)]

    def _feed(self, text: str) -> None:
        self._hash.update(text.encode("utf-8", "backslashreplace") + b"\0")


def _state(value: Any) -> list[Any]:
    """Return what an object of any class holds, else how it is written."""
    if isinstance(value, np.random.Generator):
        return [value.bit_generator.state]
    if isinstance(value, np.random.RandomState | random.Random):
        ask: Callable[[], Any] = getattr(value, "get_state", None) or value.getstate  # type: ignore[union-attr]
        return [ask()]
    held: list[Any] = []
    with suppress(Exception):  # their code, such as a property
        held += [vars(value)] if hasattr(value, "__dict__") else [repr(value)]
    return held


def _is_full(cell: Any) -> bool:
    try:
        return cell.cell_contents is not None
    except ValueError:  # a variable that has no value yet
        return False
