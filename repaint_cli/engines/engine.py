"""What every engine has in common: plans go in, outcomes come out as the runs end.

A run is idempotent: absent it is begun, unfinished it goes on, finished it is left alone. So a
retry, the same command typed again and a job that a queue system starts anew are one thing.
"""

import traceback
import uuid
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import monotonic, sleep

from repaint_cli.errors import CheckpointError, RepaintError, as_line, some
from repaint_cli.files.lease import Lease
from repaint_cli.files.lock import Locked
from repaint_cli.runs.carry_out import carry_out
from repaint_cli.runs.owner import begun_run
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.record import RunRecord

ENDING_SECONDS = 60.0
"""For an earlier process of the same driver to end, which holds the folder until then."""


@dataclass(frozen=True)
class Outcome:
    """How a run ended."""

    plan: Plan
    error: Exception | None = None
    """What stopped it; None where the run is finished."""
    tries: int = 1
    """How many processes it took."""

    @property
    def folder(self) -> Path:
        """The run's folder."""
        return self.plan.folder

    @property
    def reason(self) -> str:
        """Why it failed, in a line."""
        if self.error is None or isinstance(self.error, RepaintError):
            return str(self.error or "")
        return as_line(self.error)[0]


class RunsFailed(RepaintError):
    """Some of several runs failed; the others went on."""

    @classmethod
    def of(cls, failed: Sequence[Outcome], total: int, again: str) -> "RunsFailed":
        """Say which of so many failed and why, and with which command they go on."""
        reasons = some([f"{one.folder}: {one.reason}" for one in failed], 4, "; ")
        rest = "finished runs are kept; " if len(failed) < total else ""
        return cls(
            f"{len(failed)} of {total} run{'s' * (total > 1)} failed: {reasons}; {rest}"
            f"go on with: {again}"
        )


class Engine(ABC):
    """Carries out plans; as a context it ends its processes, however the block ends."""

    def __init__(self) -> None:
        self.driver = uuid.uuid4().hex
        """Names this command to the runs that it begins."""

    @abstractmethod
    def run(self, plans: Sequence[Plan]) -> Iterator[Outcome]:
        """Carry out plans, several at a time; yield how each ended, as they end.

        A run that fails by its own error is not tried again, and the others go on; one whose
        process was lost goes on in another. Whoever stops asking stops the runs.
        """

    def __enter__(self) -> "Engine":
        """Return the engine."""
        return self

    def __exit__(self, *_: object) -> None:
        """End what is still being done."""
        self.close()

    def close(self) -> None:  # noqa: B027 - an engine may have nothing to end
        """End what is still being done."""


def is_finished(plan: Plan) -> bool:
    """Tell whether a plan's folder holds all that its run leaves."""
    if not plan.files.is_run():
        return False
    try:
        record = RunRecord.read(plan.files)
    except CheckpointError:  # which going on with the run will say
        return False
    ended = record.state == "finished" and record.iterations >= plan.task.ppo.n_iterations
    return ended and all(plan.files.policy(seed).is_file() for seed in plan.seeds)


def carry_on(plan: Plan, driver: str) -> None:
    """Begin a plan's run, go on with it, or leave it where it is finished.

    Args:
        plan: of the run.
        driver: names the command that the run is of; an earlier process of the same command that
            still ends is waited for.

    Raises:
        Locked: another command's process writes the run.
        RepaintError: what stopped the run.
    """
    until = monotonic() + ENDING_SECONDS
    while not is_finished(plan):
        try:
            carry_out(begun_run(plan, driver), finish_interrupted=False)
            return
        except Locked:
            if not Lease.is_of(plan.folder, driver) or monotonic() > until:
                raise
            sleep(1)


def as_sent(error: Exception) -> Exception:
    """Return an error as it is sent to another process, with its traceback for --debug."""
    ours = isinstance(error, RepaintError)  # others may not survive the way
    sent = error if ours else RuntimeError(f"{type(error).__name__}: {error}")
    sent.add_note(traceback.format_exc())
    return sent
