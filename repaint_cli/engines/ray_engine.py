"""Runs on the machines of a Ray cluster: a task each, in a process of its own.

Ray places the tasks and says which were lost; that a lost one goes on is counted here, since Ray
itself would start a run for ever that takes more memory than there is.
"""

import os
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from repaint_cli import process
from repaint_cli.activity import doing, progress
from repaint_cli.engines import ray_node
from repaint_cli.engines.engine import Engine, Outcome
from repaint_cli.engines.options import EngineOptions, RunsWatcher
from repaint_cli.engines.ray_cluster import Cluster
from repaint_cli.engines.ray_probe import Probe
from repaint_cli.errors import EngineError
from repaint_cli.files.atomic import sha256
from repaint_cli.files.lease import Lease
from repaint_cli.runs.plan import Plan

GRACE_SECONDS = 10.0
"""For a run to end when asked; then its process is killed, which loses no finished iteration."""
LOOK_SECONDS = 1.0


class RayEngine(Engine):
    """Carries out runs with Ray."""

    def __init__(self, options: EngineOptions, watcher: RunsWatcher) -> None:
        super().__init__()
        self._options, self._watcher = options, watcher
        self._cluster = Cluster(options.engine.partition(":")[2])
        self._ray = self._cluster.ray
        self._probe = Probe(self._cluster, self.driver, watcher)
        self._here = os.getcwd()
        self._teachers = dict[str, Any]()
        threads = process.environment() | process.thread_limits(self._cpus)
        self._environment = {"env_vars": threads}
        self._train = self._ray.remote(
            num_cpus=self._cpus, num_gpus=options.gpus_per_run or 0, max_retries=0, max_calls=1,
            runtime_env=self._environment,
        )(ray_node.train)  # fmt: skip

    @property
    def _cpus(self) -> int:
        return self._options.cpus_per_run or 1

    def run(self, plans: Sequence[Plan]) -> Iterator[Outcome]:
        """Carry out plans; see `Engine`."""
        if not plans:
            return
        self._cluster.check_room(self._cpus, self._options.gpus_per_run or 0, self._watcher)
        roots = {str(plan.folder.parent.absolute()) for plan in plans}
        self._probe.look(sorted(roots), self._environment)
        waiting = deque((plan, 1) for plan in plans)
        running = dict[Any, tuple[Plan, int]]()
        jobs, ended = self._options.jobs, 0
        most = jobs or len(plans)
        with doing("training with ray" + (f", {jobs} at a time" if jobs else "")):
            try:
                while waiting or running:
                    while waiting and len(running) < most:
                        plan, number = waiting.popleft()
                        running[self._train.remote(self._job(plan))] = plan, number
                    progress(ended, len(plans), "runs")
                    done, _ = self._cluster.waiting(
                        self._ray.wait, list(running), timeout=LOOK_SECONDS
                    )
                    for reference in done:
                        plan, number = running.pop(reference)
                        if outcome := self._outcome(reference, plan, number):
                            ended += 1
                            yield outcome
                        else:
                            waiting.appendleft((plan, number + 1))
            finally:
                self._stop(running)

    def _job(self, plan: Plan) -> ray_node.Job:
        """Return what is sent of a plan."""
        files = {file.path for file in (*plan.teachers, *(plan.acting or ()))}
        digests = {str(path): sha256(path) for path in files}
        for path in files:
            digest = digests[str(path)]
            if digest not in self._teachers:
                self._teachers[digest] = self._ray.put(path.read_bytes())
        own = replace(plan, folder=plan.folder.absolute())
        marker = own.folder.parent / ray_node.marker_name(self.driver)
        sent = {digest: self._teachers[digest] for digest in digests.values()}
        plan_there = self._ray.put(own)
        return ray_node.Job(plan_there, self.driver, str(marker), self._here, sent, digests)

    def _outcome(self, reference: Any, plan: Plan, number: int) -> Outcome | None:
        """Return how a run ended, or None if it is to go on in another process."""
        errors = self._ray.exceptions
        try:
            return Outcome(plan, self._ray.get(reference), number)
        except (errors.RayTaskError, errors.RuntimeEnvSetupError) as error:  # before it began
            return Outcome(plan, EngineError(_line(error)), number)
        except errors.RayError as error:
            lease = Lease.read(plan.folder)
            where = f" on {lease.host}" if lease else ""
            lost = f"its process{where} was lost ({type(error).__name__}: {_line(error)})"
        if number > self._options.retries:
            return Outcome(plan, EngineError(lost), number)
        self._watcher.notice(f"{plan.folder}: {lost}; it goes on in another one")
        return None

    def _stop(self, running: dict[Any, tuple[Plan, int]]) -> None:
        """End runs: ask them first, then kill their processes."""
        if not running:
            return
        with suppress(self._ray.exceptions.RayError):
            for reference in running:
                self._ray.cancel(reference)
            _, left = self._ray.wait(list(running), num_returns=len(running), timeout=GRACE_SECONDS)
            for reference in left:
                self._ray.cancel(reference, force=True)

    def close(self) -> None:
        """Leave the cluster; one that was started here ends."""
        self._probe.close()
        self._cluster.close()


def _line(error: Exception) -> str:
    """Return the first sentence of an error of Ray's last line: what happened on the machine."""
    lines = [line for line in str(error).strip().splitlines() if line.strip()] or [""]
    return lines[-1].strip().partition(". ")[0][:300]
