"""What an experiment measured: curves by panel and variant, from its runs or from its CSV.

The CSV is tidy, a row for each panel, variant, seed and iteration, so that a table or figure can be
made again from it alone.
"""

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from repaint_cli.errors import CheckpointError, reported_as
from repaint_cli.experiments.planned import PlannedExperiment
from repaint_cli.experiments.schema import Experiment, Panel
from repaint_cli.files.atomic import write_text
from repaint_cli.files.limits import read_rows
from repaint_cli.runs.folder import RunFolder
from repaint_cli.runs.reader import READ_COLUMNS, RecordedRun
from repaint_cli.runs.record import RunRecord
from repaint_cli.tasks.card_files import read_task

COLUMNS = (
    "experiment", "panel", "variant", "method", "seed", "iteration", "env_steps", "seconds",
    "return", "progress",
)  # fmt: skip
"""Of curves.csv."""

NUMBERS = {
    "env_steps": "env_steps", "seconds": "seconds", "eval_return": "return",
    "eval_progress": "progress",
}  # fmt: skip
"""Columns of a run's metrics.csv, and what they are called here."""


@dataclass(frozen=True)
class MeasuredPanel:
    """A panel as it was measured."""

    experiment: str
    """Whose panel it is."""
    panel: Panel
    runs: dict[str, RecordedRun]
    """By variant."""


def measured(planned: PlannedExperiment) -> list[MeasuredPanel]:
    """Return what the runs of a trained experiment measured.

    Raises:
        CheckpointError: the files of a run are damaged.
    """
    panels = []
    for own in planned.panels:
        runs = {name: read for name, run in own.runs.items() if (read := run.read())}
        panels.append(MeasuredPanel(own.experiment, own.panel, runs))
    return panels


def write_curves(panels: Iterable[MeasuredPanel], path: Path) -> None:
    """Write what was measured as CSV.

    Raises:
        StoreError: the file cannot be written.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for own in panels:
        for variant, run in own.runs.items():
            labels = (own.experiment, own.panel.title, variant, run.method)
            writer.writerows([*labels, *cells] for cells in _cells(run))
    write_text(path, text.getvalue())


def _cells(run: RecordedRun) -> Iterator[list[object]]:
    columns = [run.rows[name] for name in NUMBERS]
    for s, seed in enumerate(run.seeds):
        for k in range(run.returns.shape[1]):
            numbers = [column[s, k] for column in columns]
            yield [seed, k + 1, *map(_cell, numbers)]


def _cell(number: float) -> str:
    """Write whole numbers whole, such as steps, and others with nine digits."""
    if np.isnan(number):
        return ""
    return f"{number:.0f}" if number == round(number) else f"{number:.9g}"


def read_curves(path: Path, experiment: Experiment) -> list[MeasuredPanel]:
    """Return what was measured, from the CSV of an experiment that does not gather others.

    Raises:
        CheckpointError: the file is damaged or of another version, or lacks a panel or variant.
    """
    table: dict[tuple[str, str], list[dict[str, str]]] = {}
    try:
        with reported_as(CheckpointError):
            for row in read_rows(path, COLUMNS):
                table.setdefault((row["panel"], row["variant"]), []).append(row)
    except CheckpointError as error:
        again = f"repaint reproduce {experiment.name}"
        raise CheckpointError(
            f"{error}; it may be of another version of repaint, make it again: {again}"
        ) from error
    panels = []
    for panel in experiment.panels:
        runs = {}
        for variant in experiment.variants_of(panel):
            rows = table.get((panel.title, variant.name))
            if rows is None:
                raise CheckpointError(
                    f"{path} has no '{variant.name}' in '{panel.title}', which experiment "
                    f"'{experiment.name}' has; make it again: repaint reproduce {experiment.name}"
                )
            runs[variant.name] = _run(path, panel, rows)
        panels.append(MeasuredPanel(experiment.name, panel, runs))
    return panels


def _run(path: Path, panel: Panel, rows: Sequence[dict[str, str]]) -> RecordedRun:
    """Return the rows of one variant as the run that they were written of."""
    seeds = list(dict.fromkeys(int(row["seed"]) for row in rows))
    shape, n = (len(seeds), -1), len(rows)
    if n % len(seeds):
        raise CheckpointError(
            f"{path} is damaged: expected as many iterations of each seed of '{rows[0]['variant']}'"
        )
    try:
        numbers = {
            name: np.array([float(row[column] or "nan") for row in rows]).reshape(shape)
            for name, column in NUMBERS.items()
        }
        record = RunRecord(method=rows[0]["method"], seeds=seeds, task={}, teachers=[])
    except ValueError as error:
        raise CheckpointError(f"{path} is damaged: {error!s:.200}") from error
    nothing = np.full(numbers["eval_return"].shape, np.nan)
    cells = {name: numbers.get(name, nothing) for name in READ_COLUMNS}
    return RecordedRun(RunFolder(path.parent), record, read_task(panel.task), cells)
