"""TensorBoard events of a run, for those who watch there."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from repaint_cli.runs.folder import RunFolder, remove
from repaint_cli.runs.trackers.tracker import TrackedRun, Tracker

EVENT_FILES = "events.out.tfevents.*"


class TensorBoard(Tracker):
    """Scalars in the run's folder, a writer per seed.

    They begin anew when a run goes on: so they have no hole, whether the run was killed before
    they were on disk, or went on without them.
    """

    title = "TensorBoard"

    def __init__(self, run: TrackedRun) -> None:
        super().__init__(run)
        self._writers = dict[int, Any]()
        self._earlier = list[Path]()

    @classmethod
    def place(cls, files: RunFolder) -> Path:
        """Return the folder of its events."""
        return files.tensorboard

    def open(self) -> int:
        """Begin anew; earlier events stay until all is written again."""
        from torch.utils.tensorboard import SummaryWriter

        folder = self.place(self.run.files)
        places = {seed: folder / f"seed-{seed}" for seed in self.run.seeds}
        self._earlier = [path for place in places.values() for path in place.glob(EVENT_FILES)]
        self._writers = {s: SummaryWriter(str(p), purge_step=1) for s, p in places.items()}
        return 0

    def write(self, k: int, numbers: Mapping[int, Mapping[str, float]], when: float) -> None:
        """Write an iteration's scalars."""
        for seed, scalars in numbers.items():
            for name, value in scalars.items():
                self._writers[seed].add_scalar(name, value, k, when)

    def caught_up(self) -> None:
        """Remove the earlier events."""
        for writer in self._writers.values():
            writer.flush()
        for path in self._earlier:
            remove(path)

    def close(self, finished: bool) -> None:
        """Close the files."""
        for writer in self._writers.values():
            writer.close()
