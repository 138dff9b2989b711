"""What can go wrong, as a tree; the number is the exit code of the command line.

A class without a number has that of the class above.

```
RepaintError                1   anything the program can explain in a line
├── UsageError              2   an option is malformed, missing, or not for what it is given with
│   └── NotFound                an unknown task, teacher, run, method or setting
├── CardError               3   a card, a setting or an environment is not as it must be
│   └── RewardFailed            a user's reward function failed in a step
├── TeacherMismatch         4   a teacher and a task do not fit
├── CheckpointError         5   a weights file is absent, damaged, or of another shape
├── DivergedError           6   a loss, a weight or an observation is not finite
├── StoreError              7   a file or folder cannot be written, or exists already
├── RenderError             8   no offscreen renderer works here
├── GameError               9   a game that is no part of repaint is absent or does not run
├── DeviceError            10   no GPU works, or it is too small
└── EngineError            11   what carries out runs is absent, not reached, or sees no folder

OSError                     7   the operating system refuses something else
MemoryError                 1   there is not enough memory
any other exception        70   a mistake in repaint
KeyboardInterrupt         130   Ctrl-C
Terminated                143   SIGTERM
```

Messages say what was wanted, what was found and what to do, in one line.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches


class RepaintError(Exception):
    """Anything the program can explain to a person in a line."""

    exit_code = 1


class UsageError(RepaintError):
    """An option is malformed, missing, or not for what it is given with."""

    exit_code = 2


class NotFound(UsageError):
    """An unknown task, teacher, run, method or setting."""

    @classmethod
    def named(cls, kind: str, name: str, known: Iterable[str], where: str) -> "NotFound":
        """Say that `name` is no `kind`, which names are near, and where they are listed."""
        name = f"{name:.200}"
        near = get_close_matches(name, list(known), n=3, cutoff=0.5)
        hint = f"; did you mean {' or '.join(near)}?" if near else ";"
        return cls(f"unknown {kind} {name!r}{hint} see: {where}")


class CardError(RepaintError):
    """A card, a setting or an environment is not as it must be."""

    exit_code = 3


class RewardFailed(CardError):
    """A user's reward function failed in a step, or paid what is no reward."""

    def __init__(self, place: str, moment: str = "") -> None:
        """Say where in the file and why it was, which tells failures apart, and in which step."""
        super().__init__(f"{place} ({moment})" if moment else place)
        self.place = place


class TeacherMismatch(RepaintError):
    """A teacher and a task do not fit."""

    exit_code = 4


class CheckpointError(RepaintError):
    """A weights file is absent, damaged, or of another shape."""

    exit_code = 5


class DamagedFile(Exception):
    """A file is absent, damaged or too large, for a reader that does not know what the file is.

    It has no exit code: the caller raises it as the error of that kind of file; see `reported_as`.
    """


@contextmanager
def reported_as(kind: type[RepaintError]) -> Iterator[None]:
    """Raise a `DamagedFile` as the error of what the file is, such as a card or a teacher."""
    try:
        yield
    except DamagedFile as error:
        raise kind(str(error)) from error


class DivergedError(RepaintError):
    """A loss, a weight or an observation is not finite."""

    exit_code = 6

    def __init__(self, message: str, row: int | None = None) -> None:
        """Say what it was, and of which of the seeds that train side by side, counted from 0."""
        super().__init__(message)
        self.row = row

    @classmethod
    def of_loss(cls, name: str, value: float, row: int) -> "DivergedError":
        """Say which part of the loss it was."""
        return cls(
            f"expected a finite {name}, found {value}; "
            "a smaller ppo.learning_rate or rewards of a smaller scale may help",
            row=row,
        )


def some(names: Sequence[str], most: int = 8, between: str = ", ") -> str:
    """Return the first of some names for a message, and how many more there are."""
    rest = f" and {len(names) - most:,} more" if len(names) > most else ""
    return between.join(names[:most]) + rest


@contextmanager
def locate_divergence(seeds: Sequence[int], moment: str) -> Iterator[None]:
    """Put before the text of a DivergedError when it was raised, and for which run seed.

    Args:
        seeds: the S run seeds that train side by side.
        moment: when, such as "iteration 3".

    Raises:
        DivergedError: the block raises a DivergedError.
    """
    try:
        yield
    except DivergedError as error:
        seed = "" if error.row is None else f", seed {seeds[error.row]}"
        raise DivergedError(f"{moment}{seed}: {error}") from error


class StoreError(RepaintError):
    """A file or folder cannot be written, or exists already."""

    exit_code = 7


class OutputError(StoreError):
    """Standard output takes nothing: it is closed, or its disk is full."""


class RenderError(RepaintError):
    """No offscreen renderer works on this machine."""

    exit_code = 8


class GameError(RepaintError):
    """A game that is no part of repaint, such as StarCraft II, is absent or does not run."""

    exit_code = 9


class DeviceError(RepaintError):
    """No GPU works on this machine, or it is too small."""

    exit_code = 10


class EngineError(RepaintError):
    """What carries out runs, such as Ray, is absent or not reached, or does not see a folder."""

    exit_code = 11


class Terminated(BaseException):
    """A scheduler asked the process to end (SIGTERM)."""


MISTAKE = 70
"""Exit code of what nobody foresaw."""

NO_MEMORY = (
    "alloc", "Cannot allocate memory", "failed to map segment", "can't start new thread",
    "Could not find/load shared object file 'libllvmlite",
)  # fmt: skip
"""What libraries say where they found no memory, which they do in errors of many kinds."""


def as_line(error: Exception) -> tuple[str, int]:
    """Return a line about what nobody foresaw, and the exit code."""
    message = (str(error).strip().splitlines() or [""])[0][:300]
    hint = "the traceback: repaint --debug …"
    if isinstance(error, MemoryError) or any(text in str(error) for text in NO_MEMORY):
        what = message or "no more can be had"
        return (
            f"not enough memory ({what}); raise its limit (ulimit -v), or take fewer seeds, "
            f"environments (ppo.n_envs) or --jobs; {hint}",
            RepaintError.exit_code,
        )
    if isinstance(error, OSError) and error.strerror:
        name = "" if error.filename is None else f" '{error.filename!s:.80}'"
        return f"the operating system refuses{name}: {error.strerror}; {hint}", StoreError.exit_code
    kind = type(error).__name__ + (": " if message else "")
    return f"this is a mistake in repaint, please report it: {kind}{message}; {hint}", MISTAKE
