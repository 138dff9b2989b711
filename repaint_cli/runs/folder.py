"""A run's folder: the one place that names its files."""

from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from repaint_cli.files.atomic import TEMPORARY_PREFIX, write_errors
from repaint_cli.files.lock import folder_lock

RUNS = Path("runs")
"""Where runs are, unless they are put elsewhere, and evaluations that belong to no run."""

RECORD = "run.json"
"""What makes a folder a run's."""

PLANS = "compare.json"
"""What a folder of several runs that were planned together holds beside them."""

PAGE = "report.html"
"""The page of a run or of a comparison, in its folder."""


@dataclass(frozen=True)
class RunFolder:
    """Where each file of a run lies."""

    path: Path
    """Of the folder itself."""

    @property
    def record(self) -> Path:
        """The settings, versions and state, as JSON."""
        return self.path / RECORD

    @property
    def new_alarms(self) -> Path:
        """The alarms since run.json was written last, a JSON object a line."""
        return self.path / "new-alarms.jsonl"

    @property
    def metrics(self) -> Path:
        """A row for each iteration and seed, as CSV."""
        return self.path / "metrics.csv"

    @property
    def checkpoint(self) -> Path:
        """All that the learner is after the last finished iteration."""
        return self.path / "checkpoint.safetensors"

    def earlier_checkpoint(self, k: int) -> Path:
        """The checkpoint after iteration k, once there is a later one."""
        return self.path / f"checkpoint-{k:05}.safetensors"

    def earlier_checkpoints(self) -> dict[int, Path]:
        """Return the checkpoints before the last by iteration, the newest first."""
        return dict(reversed(_by_number(self.path, "checkpoint-").items()))

    @property
    def best(self) -> Path:
        """The best evaluated policy so far, a teacher's file."""
        return self.path / "best.safetensors"

    def policy(self, seed: int) -> Path:
        """A seed's last policy, a teacher's file."""
        return self.path / f"seed-{seed}.safetensors"

    @property
    def evaluations(self) -> Path:
        """The folder of the first seed's evaluations."""
        return self.path / "evaluations"

    def evaluation(self, k: int) -> Path:
        """The first seed's evaluation after iteration k."""
        return self.evaluations / f"{k:05}.safetensors"

    def kept_evaluations(self) -> dict[int, Path]:
        """Return the first seed's evaluations by iteration, in order."""
        return _by_number(self.evaluations, "")

    @property
    def environment_log(self) -> Path:
        """What the environment printed, where it printed anything."""
        return self.path / "environment.log"

    @property
    def tensorboard(self) -> Path:
        """The folder of TensorBoard's events."""
        return self.path / "tensorboard"

    @property
    def curves(self) -> Path:
        """The figure of the learning curve."""
        return self.path / "curves.png"

    @property
    def trajectories(self) -> Path:
        """The figure of some evaluations' paths."""
        return self.path / "trajectories.png"

    @property
    def eval_record(self) -> Path:
        """How `repaint eval` went, as JSON."""
        return self.path / "eval.json"

    @property
    def eval_trajectories(self) -> Path:
        """The figure of the paths in `repaint eval`."""
        return self.path / "eval-trajectories.png"

    @property
    def film(self) -> Path:
        """The film of episodes of `repaint eval`."""
        return self.path / "video.mp4"

    @property
    def page(self) -> Path:
        """The page of the run that a browser shows."""
        return self.path / PAGE

    def is_run(self) -> bool:
        """Tell whether a run has been begun here."""
        return self.record.is_file()

    def locked(self) -> AbstractContextManager[None]:
        """Hold the folder, so that no other process writes this run.

        Raises:
            StoreError: another process holds the folder.
        """
        return folder_lock(self.path)

    def forget_after(self, k: int) -> None:
        """Remove the evaluations after iteration k, and checkpoints that are no earlier than it.

        Raises:
            StoreError: a file cannot be removed.
        """
        later = [path for n, path in self.kept_evaluations().items() if n > k]
        later += [path for n, path in self.earlier_checkpoints().items() if n >= k]
        for path in later:
            remove(path)

    def remove_unfinished(self) -> None:
        """Remove the files that a killed process had not finished.

        Raises:
            StoreError: a file cannot be removed.
        """
        for path in self.path.rglob(f"{TEMPORARY_PREFIX}*"):
            remove(path)


def runs_in(root: Path, *, deep: bool = False) -> list[RunFolder]:
    """Return the runs whose folders lie in a folder, or anywhere below it if `deep`."""
    records = root.rglob(RECORD) if deep else root.glob(f"*/{RECORD}")
    return [RunFolder(path.parent) for path in records]


def remove(path: Path) -> None:
    """Remove a file, where it is there.

    Raises:
        StoreError: the file cannot be removed.
    """
    with write_errors(path):
        path.unlink(missing_ok=True)


def _by_number(folder: Path, prefix: str) -> dict[int, Path]:
    """Return a folder's tensor files called so and a number, by that number, in order."""
    files = [
        (path.stem.removeprefix(prefix), path) for path in folder.glob(f"{prefix}*.safetensors")
    ]
    return dict(sorted((int(number), path) for number, path in files if number.isdecimal()))
