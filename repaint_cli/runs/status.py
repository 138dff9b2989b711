"""How far runs are, read from their folders while they train, wherever they do."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from time import time
from typing import Any

from repaint_cli.errors import CheckpointError, NotFound
from repaint_cli.files.lease import SILENT_SECONDS, Lease
from repaint_cli.runs.elsewhere import runs_from_here
from repaint_cli.runs.folder import PLANS, RUNS, RunFolder, runs_in
from repaint_cli.runs.kept_records import kept_records
from repaint_cli.runs.newest_rows import NewestRows
from repaint_cli.runs.record import RunRecord

WAITING, RUNNING, STOPPED, KILLED, FAILED, FINISHED = (
    "waiting", "running", "stopped", "killed", "failed", "finished"
)  # fmt: skip
"""States: killed is one that says it runs, and whose process is gone."""

ENDED = {STOPPED, KILLED, FAILED, FINISHED, "damaged"}
"""States in which nothing comes by itself."""

MISSED_ITERATIONS, SHORTEST_SILENCE = 3, 60.0
"""After so many iterations, and seconds, without a sign a process elsewhere counts as gone."""


@dataclass(frozen=True)
class RunStatus:
    """How far a run is."""

    folder: str
    """Where it lies."""
    state: str
    """waiting, running, stopped, killed, failed, finished, or damaged."""
    iteration: int = 0
    """The last finished one."""
    iterations: int = 0
    """How many it is to have."""
    mean_return: float | None = None
    """The last evaluation's, the mean over seeds."""
    seconds: float = 0.0
    """How long it has trained."""
    seconds_left: float | None = None
    """About how long it will train yet, where it runs."""
    node: str = ""
    """The machine that trains it, or did last."""
    attempt: int = 0
    """How many processes have trained it."""

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON."""
        return asdict(self)


def silence_of(pace: float | None) -> float:
    """Return after how long without a sign a process elsewhere counts as gone, s.

    Args:
        pace: how long its last iterations took, s; None where that is not known.
    """
    return max(SHORTEST_SILENCE, MISSED_ITERATIONS * pace) if pace else SILENT_SECONDS


def status_of(folder: Path, planned: int = 0) -> RunStatus:
    """Return how far a run is; `planned` is its number of iterations while it has not begun."""
    files = RunFolder(folder)
    if not files.is_run():
        return RunStatus(str(folder), WAITING, iterations=planned)
    try:
        record = RunRecord.read(files)
        total = int(record.task["ppo"]["n_iterations"])
    except (CheckpointError, LookupError, TypeError, ValueError):
        return RunStatus(str(folder), "damaged")
    rows, lease = NewestRows.read(files.metrics, len(record.seeds)), Lease.read(folder)
    state = _state(record, lease, folder, rows)
    left = None
    if state == RUNNING and rows.pace:
        left = max(0.0, (total - rows.iteration) * rows.pace - _since(files.metrics))
    return RunStatus(
        str(folder), state, rows.iteration, total, rows.mean_return, rows.seconds, left,
        lease.host if lease else record.host, lease.attempt if lease else record.attempt,
    )  # fmt: skip


def _state(record: RunRecord, lease: Lease | None, folder: Path, rows: NewestRows) -> str:
    if lease:
        return RUNNING if lease.alive(folder, silence_of(rows.pace)) else KILLED
    if record.state == "interrupted":
        return FAILED if record.failure else STOPPED
    return record.state if record.state in (FINISHED, FAILED) else KILLED


def _since(path: Path) -> float:
    """Return how long ago a file was written, by the clock of this machine, s."""
    try:
        return max(0.0, time() - path.stat().st_mtime)
    except OSError:
        return 0.0


def statuses(root: Path | None = None) -> list[RunStatus]:
    """Return how far runs are.

    Args:
        root: a run, or a folder with runs below it, some of which may only be planned. Where
            absent, the runs below runs/ and those begun from here.

    Raises:
        NotFound: there is no run.
        CheckpointError: a list of planned runs is damaged.
    """
    if root is None:
        planned = _below(RUNS) | {one.path: 0 for one in runs_from_here() if one.is_run()}
    elif RunFolder(root).is_run():
        planned = {root: 0}
    else:
        planned = _below(root)
    if not planned:
        raise NotFound(
            f"expected runs below {root or RUNS}/, found none; train: repaint train-teacher "
            "--task reacher"
        )
    return statuses_of(planned)


def statuses_of(planned: "dict[Path, int]") -> list[RunStatus]:
    """Return how far runs are, by their folders and planned iterations."""
    return [status_of(folder, n) for folder, n in planned.items()]


def _below(root: Path) -> dict[Path, int]:
    """Return the folders of runs below another, those that are only planned with how long."""
    found: dict[Path, int] = {}
    for path in sorted({*root.glob(PLANS), *root.rglob(PLANS)}):
        for name, record in kept_records(path.parent).items():
            found[path.parent / name] = _length(record)
    for files in sorted(runs_in(root, deep=True), key=lambda one: one.path):
        found.setdefault(files.path, 0)
    return found


def _length(record: RunRecord) -> int:
    length = record.task.get("ppo", {}).get("n_iterations", 0)
    return length if isinstance(length, int) else 0


def summary_of(rows: Sequence[RunStatus]) -> str:
    """Return how many runs are in each state: "1 running, 2 waiting, 3 finished"."""
    states = [row.state for row in rows]
    order = (RUNNING, WAITING, STOPPED, KILLED, FAILED, "damaged", FINISHED)
    return ", ".join(f"{states.count(one)} {one}" for one in order if one in states)
