"""TensorBoard events of a run, for those who watch there."""

from pathlib import Path
from types import TracebackType

from repaint_cli.errors import RepaintError
from repaint_cli.runs import Report


class Events:
    """Writes the numbers of metrics.csv as scalars, a writer per seed."""

    def __init__(self, folder: Path, seeds: list[int]) -> None:
        """Open the writers.

        Raises:
            RepaintError: TensorBoard is not installed.
        """
        try:
            from torch.utils.tensorboard import SummaryWriter
        except ImportError as error:
            raise RepaintError(
                "--tensorboard needs TensorBoard: pip install 'repaint-rl[tensorboard]'"
            ) from error
        self._writers = [SummaryWriter(str(folder / f"seed-{seed}")) for seed in seeds]

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
        """Write an iteration's numbers."""
        for writer, row in zip(self._writers, report.rows, strict=True):
            for name, value in row.items():
                if name not in ("iteration", "phase"):
                    writer.add_scalar(name, value, report.stats.iteration)
