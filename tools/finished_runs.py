"""Keep the finished runs of an experiment that takes longer than one computer is at hand.

    python tools/finished_runs.py keep reproduce      # copies them from there, to be committed
    python tools/finished_runs.py restore reproduce   # puts them there: they are not trained again

Of a run its record and its metrics are kept, and of a teacher its policy. Remove what is kept of an
experiment once `tools/results.py collect` has its curves.
"""

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

from repaint_cli.errors import RepaintError
from repaint_cli.runs.folder import RunFolder, runs_in
from repaint_cli.runs.reader import RecordedRun, read_run

KEPT = Path(__file__).parents[1] / "benchmarks" / "results" / "finished-runs"
RUNS = "runs"
"""The folder of all runs, in a folder of experiments."""
TEACHERS = 50
"""The first seed of teachers; students have smaller ones."""


def keep(root: Path) -> Iterator[Path]:
    """Copy what is finished in a folder of experiments; yield the folders it is kept in."""
    for files in runs_in(root / RUNS):
        run, to = read_run(files.path), KEPT / files.path.name
        if run.record.state == "finished":
            _copy(run, to)
            yield to


def restore(root: Path) -> Iterator[Path]:
    """Copy what is kept into a folder of experiments that has no such runs; yield the folders."""
    for files in runs_in(KEPT):
        to = root / RUNS / files.path.name
        if not to.exists():
            _copy(read_run(files.path), to)
            yield to


def _copy(run: RecordedRun, to: Path) -> None:
    """Copy the files of a run, its record last: without it a folder is none."""
    files, copy = run.files, RunFolder(to)
    to.mkdir(parents=True, exist_ok=True)
    if TEACHERS <= run.seeds[0] < 2 * TEACHERS:
        shutil.copyfile(files.best, copy.best)
    shutil.copyfile(files.metrics, copy.metrics)
    shutil.copyfile(files.record, copy.record)


if __name__ == "__main__":
    VERBS = {"keep": keep, "restore": restore}
    if len(sys.argv) != 3 or sys.argv[1] not in VERBS:
        sys.exit(__doc__)
    try:
        for path in VERBS[sys.argv[1]](Path(sys.argv[2])):
            print(path)
    except RepaintError as error:
        sys.exit(f"error: {error}")
