"""A lease on a folder: who writes it now, also where the file system has no lock.

A lock ends with its process, but network file systems may have none, and a node that was cut off
knows nothing of it. So the writer puts its name into `run.lock`; whoever takes over puts another
name there, and the first looks before each write and stops.
"""

import json
import os
import socket
import tempfile
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from time import time

from repaint_cli.errors import DamagedFile, StoreError
from repaint_cli.files.atomic import guarded, write_errors, write_text
from repaint_cli.files.limits import read_json
from repaint_cli.files.lock import Locked

NAME = "run.lock"
"""Of the file, in the folder."""

SILENT_SECONDS = 600.0
"""After which a holder on another machine counts as gone, where nothing better is known."""


class TakenOver(StoreError):
    """Another process has taken the folder over meanwhile."""


@dataclass(frozen=True)
class Lease:
    """Who writes a folder."""

    driver: str = ""
    """Names the command that the process is of, which may replace it at once."""
    attempt: int = 1
    """How many processes have written the folder, this one counted."""
    host: str = field(default_factory=socket.gethostname)
    pid: int = field(default_factory=os.getpid)
    began: str = ""
    """When the process began, as the system counts, since numbers of processes come again."""
    token: str = field(default_factory=lambda: uuid.uuid4().hex)
    """Tells holders apart."""

    @classmethod
    def of_this_process(cls, driver: str, attempt: int = 1) -> "Lease":
        """Return a lease of this process for a command."""
        return cls(driver, attempt, began=_beginning(os.getpid()))

    @classmethod
    def read(cls, folder: Path) -> "Lease | None":
        """Return the lease on a folder; None where there is none that can be read."""
        with suppress(DamagedFile, TypeError, ValueError, KeyError):
            data = read_json(folder / NAME)
            return cls(
                driver=str(data["driver"]), attempt=int(data["attempt"]), host=str(data["host"]),
                pid=int(data["pid"]), began=str(data.get("began", "")), token=str(data["token"]),
            )  # fmt: skip
        return None

    @classmethod
    def is_of(cls, folder: Path, driver: str) -> bool:
        """Tell whether a process of this command holds, or held, a folder."""
        lease = cls.read(folder)
        return lease is not None and lease.driver == driver

    def write(self, folder: Path) -> None:
        """Put it into a folder; whoever held that stops before its next write.

        Raises:
            StoreError: the file cannot be written.
        """
        write_text(folder / NAME, self._text)

    @cached_property
    def _text(self) -> str:
        return json.dumps(asdict(self)) + "\n"

    def check(self, folder: Path) -> None:
        """Check that it is still the lease on a folder.

        Raises:
            TakenOver: it is not.
        """
        try:
            if (folder / NAME).read_bytes() == self._text.encode():  # nearly always, and quick
                return
        except FileNotFoundError:
            pass
        except OSError:  # a disk that is away for a moment names nobody else
            return
        now = Lease.read(folder)
        if now is None or now.token != self.token:
            who = f"process {now.pid} on {now.host}" if now else "nobody"
            raise TakenOver(
                f"{folder} is written by {who} now, no longer by process {self.pid} on "
                f"{self.host}, which stops; what is there is kept"
            )

    def renew(self, folder: Path) -> None:
        """Show that the holder is alive.

        Raises:
            TakenOver: another process has taken the folder over.
            StoreError: the file cannot be touched.
        """
        self.check(folder)
        with write_errors(folder / NAME):
            os.utime(folder / NAME)

    def alive(self, folder: Path, silent: float = SILENT_SECONDS) -> bool:
        """Tell whether the holder of a folder lives, as far as can be told from here.

        Args:
            folder: that it holds.
            silent: after how long without a sign a process on another machine counts as gone, s.
        """
        if self.host == socket.gethostname() and os.name == "posix":
            now = _beginning(self.pid)
            return _runs(self.pid) and not (now and self.began and now != self.began)
        return _age(folder) < silent

    @contextmanager
    def held(self, folder: Path) -> Iterator[None]:
        """Have every write below a folder look first whether it is still ours; give it back.

        Raises:
            TakenOver: another process has taken the folder over.
        """
        try:
            with guarded(folder, lambda: self.check(folder)):
                yield
        finally:
            self.give_back(folder)

    def give_back(self, folder: Path) -> None:
        """Take it off a folder, unless another process has taken the folder over."""
        with suppress(OSError, TakenOver):
            self.check(folder)
            (folder / NAME).unlink()


def take(folder: Path, driver: str, attempt: int, silent: float = SILENT_SECONDS) -> Lease:
    """Take the lease on a folder.

    Args:
        folder: whose.
        driver: names the command; an earlier process of the same one is replaced at once.
        attempt: how many processes have written the folder, this one counted.
        silent: see `Lease.alive`.

    Raises:
        Locked: a process of another command holds it and lives.
    """
    before = Lease.read(folder)
    ours = before and (before.host, before.pid) == (socket.gethostname(), os.getpid())
    if before and not ours and not (driver and before.driver == driver):
        check_free(folder, before, silent)
    lease = Lease.of_this_process(driver, attempt)
    lease.write(folder)
    return lease


def check_free(folder: Path, lease: Lease, silent: float) -> None:
    """Check that the holder of a lease is gone.

    Raises:
        Locked: it lives, or may live.
    """
    if lease.alive(folder, silent):
        raise Locked(
            f"{folder} is being written by another process ({lease.pid} on {lease.host}); wait for "
            f"it, or if you know that it is gone, remove {folder / NAME}"
        )


def _age(folder: Path) -> float:
    """Return how long ago the holder of a folder gave a sign, by the clock of its disk, s.

    By the clock of this machine, where nothing can be written there.
    """
    try:
        sign = (folder / NAME).stat().st_mtime
    except OSError:
        return float("inf")
    try:
        with tempfile.TemporaryFile(dir=folder) as now:
            return os.fstat(now.fileno()).st_mtime - sign
    except OSError:
        return time() - sign


def _beginning(pid: int) -> str:
    """Return when a process began: which start of the machine, how long after it; "" unknown."""
    try:
        start = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        numbers = Path(f"/proc/{pid}/stat").read_bytes().rpartition(b")")[2].split()
    except OSError:  # no Linux, or no such process
        return ""
    return f"{start}/{int(numbers[19])}"  # field 22 of proc_pid_stat(5)


def _runs(pid: int) -> bool:
    """Tell whether a process of this machine runs."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:  # another user's
        return True
    return True
