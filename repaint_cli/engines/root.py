"""The folder of runs that one command trains: no second command trains them meanwhile."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Thread

from repaint_cli.errors import StoreError
from repaint_cli.files.lease import Lease, TakenOver, take
from repaint_cli.files.lock import folder_lock

SIGN_SECONDS, SILENT_SECONDS = 20.0, 90.0
"""How often a command shows that it lives, and when one on another machine counts as gone."""


@contextmanager
def driven(root: Path, driver: str) -> Iterator[None]:
    """Hold the folder of several runs.

    Raises:
        Locked: another command trains them.
    """
    over = Event()

    def show_signs(lease: Lease) -> None:
        while not over.wait(SIGN_SECONDS):
            with suppress(StoreError):  # such as a disk that is away for a moment
                try:
                    lease.renew(root)
                except TakenOver:  # the runs' own leases stop them
                    return

    with folder_lock(root):
        lease = take(root, driver, 1, SILENT_SECONDS)
        Thread(target=show_signs, args=(lease,), name="lease", daemon=True).start()
        try:
            yield
        finally:
            over.set()
            lease.give_back(root)
