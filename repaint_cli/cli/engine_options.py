"""The options of commands that train several runs: with which engine, how many at a time."""

from typing import Annotated, Protocol

from repaint_cli.cli.options import option
from repaint_cli.engines.options import EngineOptions

WITH = "With what to train"

EngineName = Annotated[
    str,
    option(WITH, "NAME", "local, ray or ray:ADDRESS, a cluster (docs/cluster.md)."),
]
Jobs = Annotated[
    int | None,
    option(
        WITH, "INT", "How many runs at a time. Default: 1; with ray as many as there is room for."
    ),
]
CpusPerRun = Annotated[
    int | None,
    option(WITH, "INT", "Threads of a run. Default: an even share of the cores; with ray 1."),
]
GpusPerRun = Annotated[
    float | None, option(WITH, "FLOAT", "GPUs of a run with ray, such as 1 or 0.25.")
]
Retries = Annotated[
    int,
    option(WITH, "INT", "How often a run goes on in a new process after its process was lost."),
]


class _Options(Protocol):
    """What commands have in common that train several runs."""

    @property
    def engine(self) -> str: ...
    @property
    def jobs(self) -> int | None: ...
    @property
    def cpus_per_run(self) -> int | None: ...
    @property
    def gpus_per_run(self) -> float | None: ...
    @property
    def retries(self) -> int: ...


def engine_options(options: _Options) -> EngineOptions:
    """Return how runs are to be carried out.

    Raises:
        UsageError: an option is malformed, or for another engine.
    """
    chosen = EngineOptions(
        options.engine, options.jobs, options.cpus_per_run, options.gpus_per_run, options.retries
    )
    chosen.check()
    return chosen
