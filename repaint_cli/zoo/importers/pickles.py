"""Pickle files read as data: the names in them are text here, never imported or called.

Python's own unpickler runs any code in a file. This one has the opcodes that numbers, texts and
arrays need, and of the names only those in `KNOWN`. Where Python would make an object, it keeps a
record. Nothing here recurses, hashes anything but text, or allocates more than the file's size.
"""

import pickletools
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from repaint_cli.files.npy import NotAnArray, array_over
from repaint_cli.zoo.importers.pickle_names import KNOWN

MAX_OPCODES = 200_000
"""Far more than a file of statistics has."""

_NUMBERS = frozenset(f"{kind}{size}" for kind in "fiu" for size in (1, 2, 4, 8)) - {"f1"}


@dataclass(frozen=True, eq=False)
class Name:
    """A class or a function, as text."""

    text: str
    """Module and name."""


@dataclass(eq=False)
class Record:
    """An object that Python's unpickler would have made."""

    name: str
    """Of the class or function that would have made it."""
    args: tuple[Any, ...]
    """Of that call."""
    state: Any = None
    """Of the object, set after the call."""
    items: dict[str, Any] = field(default_factory=dict)
    """Of the object where it is a dict, set after the call."""


class Refused(ValueError):
    """A pickle that is damaged, or more than data; the message names what it holds."""


def parse_pickle(data: bytes) -> Any:
    """Return a pickle's value: numbers, texts, bytes, lists, tuples, dicts and records.

    Raises:
        Refused: the pickle is damaged, or more than data.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about odd escapes in the file
        try:
            return _run(data)
        except Refused:
            raise
        except (ValueError, IndexError, KeyError) as error:
            raise Refused("a broken pickle") from error


def _run(data: bytes) -> Any:
    machine = _Machine()
    for count, (opcode, argument, _) in enumerate(pickletools.genops(data)):
        if opcode.name == "STOP":
            break
        if count == MAX_OPCODES:
            raise Refused(f"more than {MAX_OPCODES} opcodes")
        step = _STEPS.get(opcode.name)
        if step is None:
            raise Refused(f"the opcode {opcode.name}")
        step(machine, argument)
    return machine.pop()


class _Machine:
    """The stack and the memo of a pickle."""

    def __init__(self) -> None:
        self.stack: list[Any] = []
        self.memo: dict[int, Any] = {}

    def push(self, value: Any) -> None:
        self.stack.append(value)

    def pop(self) -> Any:
        return self.stack.pop()

    def pop_to_mark(self) -> list[Any]:
        taken = []
        while (value := self.stack.pop()) is not _MARK:
            taken.append(value)
        return taken[::-1]

    def push_tuple(self, size: int) -> None:
        self.push(tuple([self.pop() for _ in range(size)][::-1]))

    def append(self, values: list[Any]) -> None:
        target = self.stack[-1]
        if not isinstance(target, list):
            raise Refused("an entry of what is no list")
        target.extend(values)

    def set_items(self, flat: list[Any]) -> None:
        target = self.stack[-1]
        items = target.items if isinstance(target, Record) else target
        if not isinstance(items, dict) or len(flat) % 2:
            raise Refused("an entry of what is no dict")
        for key, value in zip(flat[::2], flat[1::2], strict=True):
            if type(key) is not str:  # the hash of a text is cheap for any text
                raise Refused(f"a key that is no text but of type {type(key).__name__}")
            items[key] = value

    def push_name(self, module: Any, name: Any) -> None:
        text = f"{module}.{name}" if type(module) is type(name) is str else "a nameless thing"
        if text not in KNOWN:
            raise Refused(f"the name {text[:99]!r}")
        self.push(Name(text))

    def make(self) -> None:
        args, maker = self.pop(), self.pop()
        if not isinstance(maker, Name) or not isinstance(args, tuple):
            raise Refused("a call of what is no function")
        self.push(Record(maker.text, args))

    def build(self) -> None:
        state, record = self.pop(), self.stack[-1]
        if not isinstance(record, Record):
            raise Refused("a state of what is no object")
        record.state = state


_MARK = object()
_Step = Callable[[_Machine, Any], Any]
_VALUES = (
    "BININT", "BININT1", "BININT2", "LONG1", "LONG4", "BINFLOAT", "SHORT_BINUNICODE", "BINUNICODE",
    "BINUNICODE8", "SHORT_BINBYTES", "BINBYTES", "BINBYTES8", "BYTEARRAY8",
)  # fmt: skip
_STEPS: dict[str, _Step] = {
    **dict.fromkeys(("PROTO", "FRAME"), lambda machine, _: None),
    **dict.fromkeys(_VALUES, lambda machine, value: machine.push(value)),
    "NONE": lambda machine, _: machine.push(None),
    "NEWTRUE": lambda machine, _: machine.push(True),
    "NEWFALSE": lambda machine, _: machine.push(False),
    "EMPTY_DICT": lambda machine, _: machine.push({}),
    "EMPTY_LIST": lambda machine, _: machine.push([]),
    "EMPTY_TUPLE": lambda machine, _: machine.push(()),
    "MARK": lambda machine, _: machine.push(_MARK),
    "TUPLE": lambda machine, _: machine.push(tuple(machine.pop_to_mark())),
    "TUPLE1": lambda machine, _: machine.push_tuple(1),
    "TUPLE2": lambda machine, _: machine.push_tuple(2),
    "TUPLE3": lambda machine, _: machine.push_tuple(3),
    "APPEND": lambda machine, _: machine.append([machine.pop()]),
    "APPENDS": lambda machine, _: machine.append(machine.pop_to_mark()),
    "SETITEM": lambda machine, _: machine.set_items([machine.pop(), machine.pop()][::-1]),
    "SETITEMS": lambda machine, _: machine.set_items(machine.pop_to_mark()),
    "MEMOIZE": lambda machine, _: machine.memo.update({len(machine.memo): machine.stack[-1]}),
    **dict.fromkeys(
        ("BINPUT", "LONG_BINPUT"), lambda machine, at: machine.memo.update({at: machine.stack[-1]})
    ),
    **dict.fromkeys(("BINGET", "LONG_BINGET"), lambda machine, at: machine.push(machine.memo[at])),
    "GLOBAL": lambda machine, text: machine.push_name(*text.split(" ", 1)),
    "STACK_GLOBAL": lambda machine, _: machine.push_name(*[machine.pop(), machine.pop()][::-1]),
    **dict.fromkeys(("REDUCE", "NEWOBJ"), lambda machine, _: machine.make()),
    "BUILD": lambda machine, _: machine.build(),
}
"""What each opcode does; all others are refused."""


def array_of(value: Any) -> np.ndarray:
    """Return the array of numbers that a record describes.

    Raises:
        Refused: the value is no record of an array, or the record holds more or fewer numbers than
            its shape says.
    """
    name = value.name if isinstance(value, Record) else ""
    if name.endswith("._reconstruct") and isinstance(value.state, tuple) and len(value.state) == 5:
        _, shape, dtype, fortran, data = value.state
        return _array(data, dtype, shape, fortran=fortran is True)
    if name.endswith("._frombuffer") and len(value.args) == 4:
        data, dtype, shape, order = value.args
        return _array(data, dtype, shape, fortran=order == "F")
    raise Refused("no array of numbers")


def number_of(value: Any) -> float:
    """Return a number, or the one that a record describes.

    Raises:
        Refused: the value is no number and no record of a number.
    """
    if type(value) is float or (type(value) is int and value.bit_length() <= 64):
        return float(value)
    if isinstance(value, Record) and value.name.endswith(".scalar") and len(value.args) == 2:
        dtype, data = value.args
        return float(_array(data, dtype, ()))
    raise Refused("no number")


def _array(data: Any, dtype: Any, shape: Any, *, fortran: bool = False) -> np.ndarray:
    """Return the array that parts of a record, of any type, describe."""
    numbers = _dtype(dtype)
    sizes = isinstance(shape, tuple) and all(type(n) is int and n >= 0 for n in shape)
    if not sizes or not isinstance(data, bytes | bytearray):
        raise Refused("no array of numbers")
    try:
        return array_over(data, numbers, shape, fortran=fortran)
    except NotAnArray as error:
        raise Refused(str(error)) from error


def _dtype(value: Any) -> np.dtype[Any]:
    """Return the type of numbers that a record of a dtype describes."""
    if isinstance(value, Record) and value.name == "numpy.dtype" and value.args:
        code, state = value.args[0], value.state
        order = state[1] if isinstance(state, tuple) and len(state) > 1 else "="
        if type(code) is str and code in _NUMBERS and order in ("<", ">", "=", "|"):
            return np.dtype(f"{order}{code}")
    raise Refused("an array of other things than numbers")
