"""What Ray calls on the machines of a cluster; it imports nothing heavy before it is settled.

Ray finds these functions by name in what is installed there: no code is sent.
"""

import os
import socket
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from repaint_cli import process


@dataclass(frozen=True)
class NodeReport:
    """What one machine of a cluster says of itself."""

    host: str
    versions: dict[str, str]
    """Of what results depend on, by the name of the package."""
    unseen: tuple[str, ...]
    """Folders of runs that it does not see, or cannot write."""


@dataclass(frozen=True)
class Job:
    """A run to be carried out on another machine."""

    plan: Any
    """Ray's reference to it: libraries must not be imported before this process is settled."""
    driver: str
    """Names the command."""
    marker: str
    """A file beside the run's folder that holds this name."""
    here: str
    """The folder in which the command was typed."""
    teachers: Mapping[str, Any]
    """References of Ray to the teachers' files, by SHA-256."""
    digests: Mapping[str, str]
    """The SHA-256 of a teacher's file, by where it lies on the command's machine."""


def marker_name(driver: str) -> str:
    """Return the name of the file by which machines know the folder of a command's runs."""
    return f".repaint-{driver}"


def probe(driver: str, node: str, roots: Sequence[str]) -> NodeReport:
    """Look for the folders of runs, and leave a file in each that the command looks for."""
    _settle("")
    from repaint_cli.files.provenance import versions

    unseen = []
    for root in roots:
        marker = os.path.join(root, marker_name(driver))
        try:
            if not _holds(marker, driver):
                raise OSError("it is not there")
            with open(f"{marker}-{node}", "w", encoding="utf-8") as file:
                file.write(driver)
        except OSError:
            unseen.append(root)
    return NodeReport(socket.gethostname(), versions(), tuple(unseen))


def train(job: Job) -> Exception | None:
    """Carry out a run; return what it failed by, None if it is finished."""
    _settle(job.here)
    import ray

    from repaint_cli.engines.engine import as_sent, carry_on
    from repaint_cli.tasks import trust

    try:
        plan = _with_teachers(ray.get(job.plan), job)
        _check_marker(job)
        trust.allow_if_possible(plan.target)  # by whoever typed the command
        carry_on(plan, job.driver)
    except Exception as error:
        return as_sent(error)
    return None


def _settle(here: str) -> None:
    """Guard this process as one of ours, and go where the command was typed, if that is here.

    Ray has put the folder in which it was started on the search path.
    """
    named = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    sys.path[:] = [path for path in sys.path if path in named or path not in ("", os.getcwd())]
    process.prepare()
    if here and os.path.isdir(here):
        os.chdir(here)


def _check_marker(job: Job) -> None:
    """Check that this machine sees the folder of runs, also one that came later than the others.

    Raises:
        EngineError: it does not.
    """
    from repaint_cli.errors import EngineError

    if not _holds(job.marker, job.driver):
        raise EngineError(not_seen(socket.gethostname(), os.path.dirname(job.marker)))


def not_seen(host: str, root: str) -> str:
    """Return a line about a machine that does not see a folder of runs."""
    return (
        f"machine {host} does not see {root}, where the runs are to be, or cannot write there; "
        "begin in a folder that all machines share"
    )


def _holds(path: str, text: str) -> bool:
    try:
        with open(path, encoding="utf-8") as file:
            return file.read() == text
    except OSError:
        return False


def _with_teachers(plan: Any, job: Job) -> Any:
    """Return a plan with the teachers' files that are here: the same, or sent ones."""
    from dataclasses import replace

    acting = plan.acting and tuple(_here(file, job) for file in plan.acting)
    return replace(plan, teachers=tuple(_here(file, job) for file in plan.teachers), acting=acting)


def _here(file: Any, job: Job) -> Any:
    """Return a teacher's file that is here and holds what was sent."""
    import ray

    from repaint_cli.files.atomic import sha256
    from repaint_cli.zoo import sent

    digest = job.digests[str(file.path)]
    if not sent.has(digest):  # also where its own file is here: the run may go on elsewhere
        sent.keep(digest, ray.get(job.teachers[digest]))
    if file.path.is_file() and sha256(file.path) == digest:
        return file
    return file._replace(path=sent.sent_file(digest))
