"""A comparison as a folder that stands alone: figures, numbers, and a page that explains them."""

import csv
import io
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np

from repaint_cli.files.atomic import write_text
from repaint_cli.files.foreign import PAGE_MARK
from repaint_cli.runs.comparison import COLUMNS, Comparison, as_row
from repaint_cli.runs.figures import draw_curves
from repaint_cli.runs.reader import RecordedRun
from repaint_cli.statistics import bootstrap_mean

HEADS = (
    "run", "seeds", "K", "reduced", "steps to target", "seconds to target", "first", "area", "best",
    "final", "p",
)  # fmt: skip

PAGE = """# {task}: {labels}

Made by repaint {version}. Target: {target}. Areas are means over the first {iterations} iterations.

![learning curves](curves.png)

{table}

K is the iteration at which the mean evaluation return over seeds reaches the target, as in table 1
of the REPAINT paper; "not achieved" if it never does. Reduced is 1 - K / K of the reference; steps
are a seed's environment steps until then, its teachers' samples counted; seconds count evaluations.
First is the first evaluation (the jump-start), area the mean return over the iterations that all
runs have, best the highest point of the mean curve, final the interquartile mean of the last
evaluation. p is the chance of so large a difference in area from the reference if the two methods
were alike (a permutation test over seeds). Brackets: 95 % percentile bootstrap intervals.

Files: `comparison.csv` has these numbers and more, `curves.csv` every point of the figure,
`curves.svg` the figure for print. The runs were:

{runs}

{mark}
"""

PICTURES, TABLES = ("curves.png", "curves.svg"), ("comparison.csv", "curves.csv")
PAGE_NAME = "README.md"


def write_report(
    runs: Mapping[str, RecordedRun], comparison: Comparison, folder: Path
) -> list[Path]:
    """Write the folder; return its files.

    Raises:
        StoreError: the folder cannot be written.
    """
    pictures = [folder / name for name in PICTURES]
    for picture in pictures:
        draw_curves(runs, picture, title_of(comparison), comparison.target)
    texts = _comparison(comparison), _curves(runs), _page(runs, comparison)
    for name, text in zip((*TABLES, PAGE_NAME), texts, strict=True):
        write_text(folder / name, text)
    return report_files(folder)


def report_files(folder: Path) -> list[Path]:
    """Return the files of a report."""
    return [folder / name for name in (*PICTURES, *TABLES, PAGE_NAME)]


def title_of(comparison: Comparison) -> str:
    """Return the title of the figure: the runs if they are few, else how many there are."""
    labels = [standing.label for standing in comparison.standings]
    return f"{comparison.task}: {', '.join(labels) if len(labels) < 3 else f'{len(labels)} runs'}"


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


def _page(runs: Mapping[str, RecordedRun], comparison: Comparison) -> str:
    rows = [_row(as_row(standing)) for standing in comparison.standings]
    return PAGE.format(
        task=comparison.task,
        labels=", ".join(runs),
        version=version("repaint-rl"),
        mark=PAGE_MARK,
        target=comparison.goal,
        iterations=comparison.iterations,
        table="\n".join([_line(HEADS), "|" + "---|" * len(HEADS), *rows]),
        runs="\n".join(f"- {label}: `{run.folder}`" for label, run in runs.items()),
    )


def _row(row: Mapping[str, object]) -> str:
    def show(name: str, form: str = ".4g") -> str:
        return "-" if row[name] is None else format(row[name], form)

    def between(name: str, stem: str, form: str = ".4g") -> str:
        if row[f"{stem}_low"] is None:
            return show(name, form)
        low, high = show(f"{stem}_low", form), show(f"{stem}_high", form)
        return f"{show(name, form)} [{low}, {high}]"

    reached = "not achieved" if row["k"] is None else str(row["k"])
    cells = [
        row["run"], row["seeds"], reached, between("reduced", "reduced", ".0%"),
        show("env_steps", ",.0f"), show("seconds", ".0f"), show("first"), between("area", "area"),
        show("best"), between("final_iqm", "final"), show("p", ".2g"),
    ]  # fmt: skip
    return _line(cells)


def _line(cells: Sequence[object]) -> str:
    return f"| {' | '.join(map(str, cells))} |"
