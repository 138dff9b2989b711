"""Runs that train side by side, each in a process of its own.

The process is this module, with the number of an open pipe and its parent's: it receives a plan,
trains or measures it, and sends its answer, or what stopped it. It ends with its parent.
"""

import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from functools import partial
from multiprocessing import Pipe
from multiprocessing.connection import Connection

from repaint_cli import interruption, process
from repaint_cli.activity import doing, progress
from repaint_cli.engines.engine import Engine, Outcome, as_sent, carry_on
from repaint_cli.engines.options import EngineOptions, RunsWatcher
from repaint_cli.errors import RepaintError
from repaint_cli.runs.estimate import Estimate, estimate
from repaint_cli.runs.plan import Plan
from repaint_cli.threads import cores

GRACE_SECONDS = 5.0
"""For a process to end when asked; then it is killed, which loses no finished iteration."""


class LocalEngine(Engine):
    """Runs on this machine: each in a process of its own, a single one at a time in this one."""

    def __init__(self, options: EngineOptions, watcher: RunsWatcher) -> None:
        super().__init__()
        self._watcher = watcher
        self._jobs, self._retries = options.jobs or 1, options.retries
        self._cpus = options.cpus_per_run

    def run(self, plans: Sequence[Plan]) -> Iterator[Outcome]:
        """Carry out plans; see `Engine`. Several jobs share the cores evenly."""
        if self._jobs > 1 or self._cpus:
            yield from self._side_by_side(plans)
            return
        for plan in plans:
            yield Outcome(plan, _error_of(partial(carry_on, plan, self.driver)))

    def _side_by_side(self, plans: Sequence[Plan]) -> Iterator[Outcome]:
        workers = _Workers(self._cpus or threads_of(self._jobs))
        with ThreadPoolExecutor(self._jobs) as pool, doing(f"training, {self._jobs} at a time"):
            try:
                each = [pool.submit(self._outcome, workers, plan) for plan in plans]
                for number, done in enumerate(as_completed(each), 1):
                    progress(number, len(plans), "runs")
                    if outcome := done.result():
                        yield outcome
            finally:
                workers.stop()

    def _outcome(self, workers: "_Workers", plan: Plan) -> Outcome | None:
        """Train in new processes until one was not lost; return None if all were stopped."""
        for number in range(1, self._retries + 2):
            error = _error_of(partial(workers.ask, "train", plan, self.driver))
            if workers.stopped:
                return None
            if not isinstance(error, ProcessLost):
                return Outcome(plan, error, number)
            if number <= self._retries:
                self._watcher.notice(f"{error}; it goes on in another one")
        return Outcome(plan, error, number)


def _error_of(train: Callable[[], object]) -> Exception | None:
    """Train; return what the run failed by, which is a line for people or a mistake in repaint."""
    try:
        train()
    except Exception as error:
        return error
    return None


class ProcessLost(RepaintError):
    """The process of a run was killed, or ended without an answer."""


def threads_of(jobs: int) -> int:
    """Return how many threads each of several jobs has."""
    return max(1, cores() // jobs)


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
        self.stopped = False
        self._lock = threading.Lock()

    def ask(self, what: str, plan: Plan, driver: str = "") -> Answer:
        """Do one of the `JOBS` in a new process; return its answer, None if it was not begun.

        Raises:
            ProcessLost: the process was killed.
            RepaintError: what stopped it.
        """
        pipe, its_pipe = Pipe()
        with pipe:
            with its_pipe, self._lock:
                if self.stopped:
                    return None
                words = str(its_pipe.fileno()), str(os.getpid())
                child = subprocess.Popen(
                    process.child_command("repaint_cli.engines.local", *words),
                    env=self._environment, pass_fds=[its_pipe.fileno()],
                    stdin=subprocess.DEVNULL, stdout=2,  # what environments print is no result
                )  # fmt: skip
                self._children.append(child)
            with child:
                answer = _ask(pipe, (what, plan, driver))
        if answer is _DIED:
            raise ProcessLost(_ended(plan, child.returncode))
        if isinstance(answer, Exception):
            raise answer
        return answer

    def stop(self) -> None:
        """End all processes, and start no more."""
        with self._lock:
            self.stopped = True
            children = list(self._children)
        for child in children:
            child.terminate()
        for child in children:
            try:
                child.wait(GRACE_SECONDS)
            except subprocess.TimeoutExpired:
                child.kill()


Question = tuple[str, Plan, str]
"""One of the `JOBS`, a plan, and what names the command."""


def _ask(pipe: "Connection[Question, Answer]", question: Question) -> Answer:
    """Send a process what to do; return its answer, `_DIED` if it ended without one."""
    try:
        pipe.send(question)
        return pipe.recv()
    except (EOFError, ConnectionError):
        return _DIED


_DIED = EOFError()


def _ended(plan: Plan, code: int) -> str:
    """Return a line about a process that ended without an answer."""
    how = f"was killed (signal {-code})" if code < 0 else f"ended with exit code {code}"
    return (
        f"the process that trained {plan.method} in {plan.folder} {how}, as happens where memory "
        "runs out; take fewer --jobs"
    )


JOBS: dict[str, Callable[[Plan, str], Estimate | None]] = {
    "train": carry_on,
    "measure": lambda plan, _: estimate(plan),
}
"""What a process does with a plan."""


def main(number: str, parent: str) -> None:
    """Do what the parent process asks for."""
    interruption.end_with(int(parent))
    pipe: Connection[Answer, Question] = Connection(int(number))
    what, plan, driver = pipe.recv()
    try:
        answer: Answer = JOBS[what](plan, driver)
    except KeyboardInterrupt:  # which the parent gets, too
        sys.exit(130)
    except Exception as error:
        answer = as_sent(error)
    pipe.send(answer)


if __name__ == "__main__":
    main(*sys.argv[1:])
