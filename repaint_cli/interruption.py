"""Ctrl-C and SIGTERM: the first ends a command in order, a second ends the process at once.

The first raises an exception wherever the program is. Code of users may swallow it, in an
environment or a reward function with a bare `except:`; so it is remembered, and `check`, which is
asked after every step of an environment and every gradient step, raises it again. A second is
seen by a thread, also while a step never returns. Only compiled code that never gives the
interpreter back is out of its reach.
"""

import os
import signal
from contextlib import suppress
from threading import Thread
from time import monotonic, sleep
from types import FrameType

from repaint_cli.errors import Terminated

ENDS: dict[int, type[BaseException]] = {
    signal.SIGINT: KeyboardInterrupt,
    signal.SIGTERM: Terminated,
}
"""What each signal raises."""

AT_ONCE = 0.3
"""Seconds within which signals count as one: `timeout` sends two."""


STDOUT = 1
"""The descriptor: the stream may be closed or wrapped."""


class _Heard:
    """What was heard since `listen`."""

    raised: type[BaseException] | None = None
    """What the first signal raised."""
    pending = False
    """Whether nobody has said yet that the exception arrived."""
    first: float | None = None
    """When the first signal came, by the clock of `monotonic`."""
    watched = False
    """Whether the thread runs that sees a second."""


def listen() -> None:
    """Take note of signals from now on; SIGINT stays ignored where it is, as in `repaint … &`."""
    _Heard.raised, _Heard.pending, _Heard.first = None, False, None
    for number in ENDS:
        if number == signal.SIGTERM or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _note)
    if not _Heard.watched and os.name == "posix":
        _Heard.watched = True
        reading, writing = os.pipe()
        os.set_blocking(writing, False)
        signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
        Thread(target=_watch, args=(reading,), name="second signal", daemon=True).start()


def check() -> None:
    """Raise what the first signal raised, if code of users has swallowed it.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed.
        Terminated: the process was asked to end.
    """
    if _Heard.pending and _Heard.raised:
        raise _Heard.raised


def arrived() -> None:
    """Say that the exception of the first signal has been caught: `check` raises it no more."""
    _Heard.pending = False


def end_with(parent: int) -> None:
    """Have this process end within a second of the one that started it, however that ends."""

    def watch() -> None:
        while os.getppid() == parent:
            sleep(0.5)
        os._exit(128 + signal.SIGTERM)

    Thread(target=watch, name="parent", daemon=True).start()


def _note(number: int, frame: FrameType | None) -> None:
    if _Heard.raised is None:  # what follows the first tidies up
        _Heard.raised, _Heard.pending = ENDS[number], True
        raise _Heard.raised


def _watch(pipe: int) -> None:
    """End the process when a second signal comes; signals come through the pipe, a byte each."""
    while numbers := os.read(pipe, 64):
        now = monotonic()
        for number in ENDS.keys() & set(numbers):
            if _Heard.first is None:
                _Heard.first = now
            elif now - _Heard.first > AT_ONCE:
                _end_at_once(number)


def _end_at_once(number: int) -> None:
    with suppress(OSError):
        if os.isatty(STDOUT):
            os.write(STDOUT, b"\x1b[?25h\n")  # the cursor, which a live display hides
    os._exit(128 + number)
