"""TensorBoard events of a run, for those who watch there."""

from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import Any

from repaint_cli.errors import RepaintError
from repaint_cli.runs.metrics import Report


def require_tensorboard() -> None:
    """Check that TensorBoard is installed.

    Raises:
        RepaintError: TensorBoard is absent.
    """
    if find_spec("tensorboard") is None:
        raise RepaintError("--tensorboard needs TensorBoard: pip install 'repaint-rl[tensorboard]'")


class Events:
    """Writes the numbers of metrics.csv as scalars, a writer per seed."""

    def __init__(self, folder: Path, seeds: list[int]) -> None:
        """Name the folders, seed by seed; they are made with the first numbers."""
        self._places = [str(folder / f"seed-{seed}") for seed in seeds]
        self._writers: list[Any] = []

    def __enter__(self) -> "Events":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for writer in self._writers:
            writer.close()

    def add(self, report: Report) -> None:
        """Write an iteration's numbers; events of an earlier process from there on are purged."""
        from torch.utils.tensorboard import SummaryWriter

        first = report.stats.iteration
        if not self._writers:
            self._writers = [SummaryWriter(place, purge_step=first) for place in self._places]
        for writer, row in zip(self._writers, report.rows, strict=True):
            for name, value in row.items():
                if name not in ("iteration", "phase"):
                    writer.add_scalar(name, value, report.stats.iteration)
