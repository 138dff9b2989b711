"""A comparison as a folder that stands alone: a page, its numbers, and figures for print."""

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from repaint_cli.files.atomic import write_text
from repaint_cli.report.statistics import bootstrap_mean
from repaint_cli.runs.comparison import COLUMNS, REFERENCE, Comparison, as_row, reference_of
from repaint_cli.runs.figures import draw_curves
from repaint_cli.runs.folder import PAGE
from repaint_cli.runs.page import Values, write_page
from repaint_cli.runs.page_files import PageFiles, pictures_of
from repaint_cli.runs.reader import RecordedRun
from repaint_cli.runs.run_command import command_of, compare_command
from repaint_cli.runs.settings_shown import differing_settings

PICTURES, TABLES = ("curves.png", "curves.svg"), ("comparison.csv", "curves.csv")


def write_report(
    runs: Mapping[str, RecordedRun], comparison: Comparison, folder: Path
) -> list[Path]:
    """Write the folder; return its files.

    Raises:
        CheckpointError: the alarms of a run are damaged.
        StoreError: the folder cannot be written.
    """
    for picture in PICTURES:
        draw_curves(runs, folder / picture, title_of(comparison), comparison.target)
    for name, text in zip(TABLES, (_comparison(comparison), _curves(runs)), strict=True):
        write_text(folder / name, text)
    _page(runs, comparison, folder / PAGE)
    return report_files(folder)


def report_files(folder: Path) -> list[Path]:
    """Return the files of a report."""
    return [folder / name for name in (PAGE, *PICTURES, *TABLES)]


def report_command(runs: Mapping[str, RecordedRun], comparison: Comparison, folder: Path) -> str:
    """Return the command that writes the report of a comparison."""
    usual = comparison.reference in (None, reference_of(runs, REFERENCE))
    basis = None if usual else runs[str(comparison.reference)].folder
    target = comparison.target if comparison.given else None
    return compare_command([run.folder for run in runs.values()], basis, target, folder)


def title_of(comparison: Comparison) -> str:
    """Return the title of the figure: the runs if they are few, else how many there are."""
    labels = [standing.label for standing in comparison.standings]
    return f"{comparison.task}: {', '.join(labels) if len(labels) < 3 else f'{len(labels)} runs'}"


def _page(runs: Mapping[str, RecordedRun], comparison: Comparison, page: Path) -> Path:
    files, several = PageFiles(page), len(runs) > 1
    heads, settings = differing_settings(runs)
    films = [film for label, run in runs.items() for film in files.films(run.files, f"{label}: ")]
    first = {label: pictures_of(run.files)[:1] for label, run in runs.items()}
    own = Values(
        title=title_of(comparison),
        kind="A comparison of runs by repaint",
        subtitle=f"{next(iter(runs.values())).task.summary:.300}",
        facts=[
            ("runs", str(len(runs))),
            ("compared with", comparison.reference or "nothing: no run is from scratch"),
            ("target", comparison.goal),
            ("compared over", f"the first {comparison.iterations} iterations"),
            *([("warning", warning)] if (warning := comparison.warning()) else []),
        ],
        films=films,
        pictures_title="Trajectories",
        pictures=[
            picture
            for label, some in first.items()
            for picture in files.pictures(some, f"{label}: ")
        ],
        settings_title="Settings in which the runs differ",
        settings_heads=heads,
        settings=settings if several else [],
        no_settings="The runs have the same settings." if several else "There is one run.",
        commands=_commands(runs, comparison, page.parent),
        versions="",
        files_note="The folder has more: comparison.csv with the numbers, curves.csv with every "
        "point, curves.png and curves.svg for print.",
    )
    return write_page(page, own, runs, comparison)


def _commands(
    runs: Mapping[str, RecordedRun], comparison: Comparison, folder: Path
) -> list[dict[str, str]]:
    return [
        {"what": "Make this page:", "text": report_command(runs, comparison, folder)},
        *(
            {"what": f"Begin a run like {label}:", "text": command_of(run.record, run.task)}
            for label, run in runs.items()
        ),
    ]


def _comparison(comparison: Comparison) -> str:
    rows = [as_row(standing) for standing in comparison.standings]
    return _csv(COLUMNS, ([_cell(row[name]) for name in COLUMNS] for row in rows))


def _curves(runs: Mapping[str, RecordedRun]) -> str:
    lines = []
    for label, run in runs.items():
        low, high = bootstrap_mean(run.returns)
        for k in range(run.returns.shape[1]):
            each = run.returns[:, k]
            numbers = [each.mean(), low[k], high[k], run.rows["env_steps"][:, k].mean()]
            seeds = " ".join(f"{value:.6g}" for value in each)
            lines.append([label, k + 1, *map(_cell, numbers), seeds])
    return _csv(("run", "iteration", "mean", "low", "high", "env_steps", "each_seed"), lines)


def _csv(names: Sequence[str], rows: object) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(rows)  # type: ignore[arg-type]
    return text.getvalue()


def _cell(value: object) -> object:
    if value is None or (isinstance(value, float | np.floating) and np.isnan(value)):
        return ""
    if isinstance(value, list):
        return " ".join("never" if k is None else str(k) for k in value)
    return f"{value:.6g}" if isinstance(value, float | np.floating) else value
