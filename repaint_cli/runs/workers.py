"""Runs that train side by side, each in a process of its own.

The process is this module, with the number of an open pipe and its parent's: it receives a plan,
trains or measures it, and sends its answer, or what stopped it. It ends with its parent.
"""

import os
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path

from repaint_cli import interruption, process
from repaint_cli.activity import doing, progress
from repaint_cli.errors import RepaintError
from repaint_cli.runs.carry_out import carry_out
from repaint_cli.runs.estimate import Estimate, estimate
from repaint_cli.runs.owner import begun_run
from repaint_cli.runs.plan import Plan
from repaint_cli.threads import cores

GRACE_SECONDS = 5.0
"""For a process to end when asked; then it is killed, which loses no finished iteration."""


def threads_of(jobs: int) -> int:
    """Return how many threads each of several jobs has."""
    return max(1, cores() // jobs)


def train_all(plans: Sequence[Plan], jobs: int) -> Iterator[Path]:
    """Carry out plans, as many at a time as there are jobs; yield folders as they finish.

    A plan whose folder holds a run goes on with it. Several jobs are processes, which share the
    cores evenly; a single one is this process.

    Raises:
        RepaintError: what stopped a run.
    """
    if jobs > 1:
        yield from train_side_by_side(plans, jobs, threads=threads_of(jobs))
        return
    for plan in plans:
        carry_out(begun_run(plan), finish_interrupted=False)
        yield plan.folder


def train_side_by_side(plans: Sequence[Plan], jobs: int, threads: int) -> Iterator[Path]:
    """Carry out plans, so many at a time with so many threads each; yield folders as they finish.

    Whoever stops asking stops the processes.

    Raises:
        RepaintError: what stopped a run, or its process was killed.
    """
    workers = _Workers(threads)
    with ThreadPoolExecutor(jobs) as pool, doing(f"training, {jobs} at a time"):
        try:
            each = as_completed([pool.submit(workers.train, plan) for plan in plans])
            for number, done in enumerate(each, 1):
                progress(number, len(plans), "runs")
                if folder := done.result():
                    yield folder
        finally:
            workers.stop()


Answer = Estimate | Exception | None
"""Of a process: what it measured, what stopped it, or that it is done."""


def measure_aside(plan: Plan, threads: int) -> Estimate:
    """Train a plan's first iterations in a process of its own, in a temporary folder.

    Raises:
        RepaintError: the run could not begin, fails in these iterations, or its process was killed.
    """
    workers = _Workers(threads)
    with ThreadPoolExecutor(1) as pool:  # where waiting for the process does not hold up Ctrl-C
        try:
            measured = pool.submit(workers.ask, "measure", plan).result()
        finally:
            workers.stop()
    if not isinstance(measured, Estimate):
        raise RepaintError("the measurement was stopped")
    return measured


class _Workers:
    """Processes that do something with a plan each."""

    def __init__(self, threads: int) -> None:
        self._environment = os.environ | process.environment() | process.thread_limits(threads)
        self._children: list[subprocess.Popen[bytes]] = []
        self._stopped = False
        self._lock = threading.Lock()

    def train(self, plan: Plan) -> Path | None:
        """Train in a new process; return the run's folder, None if it was not begun any more.

        Raises:
            RepaintError: what stopped the run, or its process was killed.
        """
        self.ask("train", plan)
        return plan.folder if plan.files.is_run() else None

    def ask(self, what: str, plan: Plan) -> Answer:
        """Do one of the `JOBS` in a new process; return its answer, None if it was not begun.

        Raises:
            RepaintError: what stopped it, or the process was killed.
        """
        pipe, its_pipe = Pipe()
        with pipe:
            with its_pipe, self._lock:
                if self._stopped:
                    return None
                words = str(its_pipe.fileno()), str(os.getpid())
                child = subprocess.Popen(
                    process.child_command("repaint_cli.runs.workers", *words),
                    env=self._environment, pass_fds=[its_pipe.fileno()],
                    stdin=subprocess.DEVNULL, stdout=2,  # what environments print is no result
                )  # fmt: skip
                self._children.append(child)
            with child:
                answer = _ask(pipe, what, plan)
        if answer is _DIED:
            raise RepaintError(_ended(plan, child.returncode))
        if isinstance(answer, Exception):
            raise answer
        return answer

    def stop(self) -> None:
        """End all processes, and start no more."""
        with self._lock:
            self._stopped = True
            children = list(self._children)
        for child in children:
            child.terminate()
        for child in children:
            try:
                child.wait(GRACE_SECONDS)
            except subprocess.TimeoutExpired:
                child.kill()


def _ask(pipe: "Connection[tuple[str, Plan], Answer]", what: str, plan: Plan) -> Answer:
    """Send a process its plan; return its answer, `_DIED` if it ended without one."""
    try:
        pipe.send((what, plan))
        return pipe.recv()
    except (EOFError, ConnectionError):
        return _DIED


_DIED = EOFError()


def _ended(plan: Plan, code: int) -> str:
    """Return a line about a process that ended without an answer."""
    how = f"was killed (signal {-code})" if code < 0 else f"ended with exit code {code}"
    if plan.files.is_run():
        what = f"go on with: {plan.resume_command}; or take fewer --jobs"
    else:
        what = "take fewer --jobs"
    return (
        f"the process that trained {plan.method} in {plan.folder} {how}, as happens where memory "
        f"runs out; {what}"
    )


def _train(plan: Plan) -> None:
    carry_out(begun_run(plan), finish_interrupted=False)


JOBS: dict[str, Callable[[Plan], Estimate | None]] = {"train": _train, "measure": estimate}
"""What a process does with a plan."""


def main(number: str, parent: str) -> None:
    """Do what the parent process asks for."""
    interruption.end_with(int(parent))
    pipe: Connection[Answer, tuple[str, Plan]] = Connection(int(number))
    what, plan = pipe.recv()
    try:
        answer: Answer = JOBS[what](plan)
    except KeyboardInterrupt:  # which the parent gets, too
        sys.exit(130)
    except Exception as error:
        ours = isinstance(error, RepaintError)  # others may not survive the way
        answer = error if ours else RuntimeError(f"{type(error).__name__}: {error}")
        answer.add_note(traceback.format_exc())  # for --debug
    pipe.send(answer)


if __name__ == "__main__":
    main(*sys.argv[1:])
