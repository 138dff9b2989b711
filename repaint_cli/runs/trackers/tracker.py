"""What is to be known of a tool that shows runs: the interface, and which tools there are.

A new one is a subclass of `Tracker` and a line in `TRACKERS`; `tracking.py` keeps them up with a
run. Numbers are those of metrics.csv, by name.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from repaint_cli.errors import DamagedFile, NotFound, RepaintError
from repaint_cli.files.atomic import as_json, write_text
from repaint_cli.files.limits import read_json
from repaint_cli.runs.folder import RunFolder

TRACKERS = {
    "tensorboard": "repaint_cli.runs.trackers.tensorboard:TensorBoard",
    "wandb": "repaint_cli.runs.trackers.wandb:WandB",
    "mlflow": "repaint_cli.runs.trackers.mlflow:MLflow",
}
"""The class of each tracker by its name, which is also the module that it needs."""


class TrackedRun(NamedTuple):
    """A run, as trackers see it."""

    files: RunFolder
    """Its folder."""
    seeds: list[int]
    """The run seeds, (S,): a tracker has a curve, or a run, for each."""
    settings: dict[str, Any]
    """All that it was begun with, as JSON: sections of numbers and texts."""

    @property
    def task(self) -> str:
        """The task's name."""
        return str(self.settings["task"]["name"])

    @property
    def title(self) -> str:
        """What the seeds' runs have in common, for people."""
        return f"{self.task} {self.files.path.name}"


class Tracker(ABC):
    """Writes a run's numbers where a tool shows them. Any method may fail with any error."""

    title: ClassVar[str]
    """The tool's name, for people."""

    def __init__(self, run: TrackedRun) -> None:
        self.run = run

    @classmethod
    @abstractmethod
    def place(cls, files: RunFolder) -> Path:
        """Return the file or folder in a run's folder that is there once it was tracked."""

    @abstractmethod
    def open(self) -> int:
        """Begin, or go on; return the last iteration that the tool has, 0 for none."""

    @abstractmethod
    def write(self, k: int, numbers: Mapping[int, Mapping[str, float]], when: float) -> None:
        """Write iteration k, that ended at the time `when` (s since 1970): numbers by seed."""

    def caught_up(self) -> None:  # noqa: B027 - most have nothing to do
        """All iterations that were done when it was opened are written."""

    @abstractmethod
    def close(self, finished: bool) -> None:
        """End, after the last iteration or, if not `finished`, before it."""


class TrackerWithIds(Tracker):
    """A tracker whose tool knows a run of each seed by an id, kept in the run's folder."""

    def __init__(self, run: TrackedRun) -> None:
        super().__init__(run)
        self.ids: dict[str, str] = {}
        """By seed."""
        self.kept = 0
        """The last iteration that was written."""
        with suppress(DamagedFile, TypeError, ValueError, KeyError, AttributeError):
            data = read_json(self.place(run.files))
            self.ids = {str(seed): str(data["ids"][str(seed)]) for seed in run.seeds}
            self.kept = int(data["iteration"])

    def keep(self, k: int) -> None:
        """Keep the ids, and that iteration k was written."""
        self.kept = k
        write_text(self.place(self.run.files), as_json({"ids": self.ids, "iteration": k}))


def tracker_class(name: str) -> type[Tracker]:
    """Return a tracker by its name; what it needs is imported when it is opened."""
    module, _, kind = TRACKERS[name].partition(":")
    tracker: type[Tracker] = getattr(import_module(module), kind)
    return tracker


def is_installed(name: str) -> bool:
    """Tell whether what a tracker needs is installed."""
    spec = find_spec(name)
    return spec is not None and spec.origin is not None  # else a folder of that name


def require(name: str) -> None:
    """Check that there is a tracker of this name, and that what it needs is installed.

    Raises:
        NotFound: there is no such tracker.
        RepaintError: it is not installed.
    """
    if name not in TRACKERS:
        raise NotFound(f"expected --track {', '.join(TRACKERS)}, found '{name:.200}'")
    if not is_installed(name):
        title = tracker_class(name).title
        raise RepaintError(f"--track {name} needs {title}: pip install {name}")
