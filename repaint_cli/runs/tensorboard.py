"""TensorBoard events of a run, for those who watch there."""

from collections.abc import Mapping
from importlib.util import find_spec
from types import TracebackType
from typing import Any

from repaint_cli.errors import CheckpointError, RepaintError, reported_as
from repaint_cli.files.limits import read_rows
from repaint_cli.runs.folder import RunFolder, remove
from repaint_cli.runs.metrics import COLUMNS, Report

EVENT_FILES = "events.out.tfevents.*"


def is_installed() -> bool:
    """Tell whether TensorBoard is installed."""
    return find_spec("tensorboard") is not None


def require_tensorboard() -> None:
    """Check that TensorBoard is installed.

    Raises:
        RepaintError: TensorBoard is absent.
    """
    if not is_installed():
        raise RepaintError("--tensorboard needs TensorBoard: pip install tensorboard")


class Events:
    """Writes the numbers of metrics.csv as scalars, a writer per seed.

    They begin anew when a run goes on, from metrics.csv: so they have no hole, whether the run was
    killed before they were on disk, or went on without them.
    """

    def __init__(self, files: RunFolder, seeds: list[int], k: int) -> None:
        """Name the folders, seed by seed.

        Args:
            files: of the run.
            seeds: the run seeds, (S,).
            k: how many iterations are done.
        """
        self._files, self._seeds, self._k = files, seeds, k
        self._writers = dict[str, Any]()

    def __enter__(self) -> "Events":
        """Write the events of the iterations that are done.

        Raises:
            CheckpointError: metrics.csv is damaged.
            StoreError: earlier events cannot be removed.
        """
        from torch.utils.tensorboard import SummaryWriter

        places = {str(seed): self._files.tensorboard / f"seed-{seed}" for seed in self._seeds}
        earlier = [path for place in places.values() for path in place.glob(EVENT_FILES)]
        self._writers = {s: SummaryWriter(str(p), purge_step=1) for s, p in places.items()}
        if self._k:
            self._write_again()
        for path in earlier:
            remove(path)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for writer in self._writers.values():
            writer.close()

    def add(self, report: Report) -> None:
        """Write an iteration's numbers."""
        for seed, row in zip(self._seeds, report.rows, strict=True):
            self._write(str(seed), row)

    def _write_again(self) -> None:
        """Write the iterations that are done, at the times at which they were."""
        with reported_as(CheckpointError):
            rows = [*read_rows(self._files.metrics, COLUMNS, appended=True)]
        began = self._files.metrics.stat().st_mtime - float(rows[-1]["seconds"])
        for row in rows:
            if int(row["iteration"]) <= self._k:
                self._write(row["seed"], row, began + float(row["seconds"]))
        for writer in self._writers.values():
            writer.flush()

    def _write(self, seed: str, row: Mapping[str, Any], when: float | None = None) -> None:
        for name, value in row.items():
            if name not in ("iteration", "seed", "phase") and value != "":
                self._writers[seed].add_scalar(name, float(value), int(row["iteration"]), when)
