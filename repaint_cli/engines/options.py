"""How runs are carried out: by which engine, how many at a time, with what."""

from dataclasses import dataclass, fields
from importlib.util import find_spec
from typing import TYPE_CHECKING

from repaint_cli.errors import EngineError, UsageError
from repaint_cli.files.commands import quoted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from repaint_cli.engines.engine import Engine, Outcome
    from repaint_cli.runs.plan import Plan

LOCAL, RAY = "local", "ray"
"""Names of engines."""

RETRIES = 3
"""How often a run whose process was lost goes on in another, unless told."""


@dataclass(frozen=True)
class EngineOptions:
    """Which engine carries out runs, and how many at a time with what."""

    engine: str = LOCAL
    """local, ray, or ray:ADDRESS."""
    jobs: int | None = None
    """How many runs at a time; where absent 1 here, with Ray as many as there is room for."""
    cpus_per_run: int | None = None
    """Threads of a run; where absent an even share of the cores here, 1 with Ray."""
    gpus_per_run: float | None = None
    """GPUs of a run, or which part of one, with Ray."""
    retries: int = RETRIES

    def check(self) -> None:
        """Check what can be without asking a cluster.

        Raises:
            UsageError: there is no such engine, a number is too small, or an option is for Ray.
            EngineError: Ray is not installed.
        """
        name, _, address = self.engine.partition(":")
        if name not in (LOCAL, RAY) or (name == LOCAL and address):
            raise UsageError(f"expected --engine local, ray or ray:ADDRESS, found {self.engine}")
        if self.jobs is not None and self.jobs < 1:
            raise UsageError(f"expected at least 1 job, found {self.jobs}")
        if self.cpus_per_run is not None and self.cpus_per_run < 1:
            raise UsageError(f"expected --cpus-per-run of at least 1, found {self.cpus_per_run}")
        if self.retries < 0:
            raise UsageError(f"expected --retries of at least 0, found {self.retries}")
        if self.gpus_per_run is not None:
            if name == LOCAL:
                raise UsageError("--gpus-per-run is for --engine ray; leave it out")
            if self.gpus_per_run < 0:
                raise UsageError(
                    f"expected --gpus-per-run of at least 0, found {self.gpus_per_run}"
                )
        if name == RAY and find_spec("ray") is None:
            raise EngineError("--engine ray needs Ray, found none; install it: pip install ray")

    @classmethod
    def of(cls, jobs: "int | EngineOptions") -> "EngineOptions":
        """Return options as they are, or those of so many jobs here; see `check`."""
        options = cls(jobs=jobs) if isinstance(jobs, int) else jobs
        options.check()
        return options

    @property
    def words(self) -> str:
        """What is typed for them, with a space before it; empty where nothing is."""
        usual = EngineOptions()
        return "".join(
            f" --{one.name.replace('_', '-')} {quoted(str(getattr(self, one.name)))}"
            for one in fields(self)
            if getattr(self, one.name) != getattr(usual, one.name)
        )

    def open(self, watcher: "RunsWatcher") -> "Engine":
        """Return the engine, which is a context; `watcher` hears its notices.

        Raises:
            UsageError: as `check`.
            EngineError: the engine is not installed, or there is no cluster at its address.
        """
        self.check()
        if self.engine == LOCAL:
            from repaint_cli.engines.local import LocalEngine

            return LocalEngine(self, watcher)
        from repaint_cli.engines.ray_engine import RayEngine

        return RayEngine(self, watcher)


class RunsWatcher:
    """Follows several runs; this base class does nothing."""

    def training(self, plans: "Sequence[Plan]") -> None:
        """These are about to be carried out."""

    def notice(self, text: str) -> None:
        """Something is to be known, and the runs go on."""

    def failed(self, outcome: "Outcome") -> None:
        """A run has failed, and the others go on."""
