"""One method against itself as a folder: a page, a figure, and every number."""

from math import isnan
from pathlib import Path

from repaint_cli.files.atomic import write_text
from repaint_cli.files.commands import command
from repaint_cli.runs.against_itself import AgainstItself, draw, title_of
from repaint_cli.runs.comparison import comparison_of
from repaint_cli.runs.comparison_rows import csv_text
from repaint_cli.runs.folder import PAGE
from repaint_cli.runs.page import Values, write_page
from repaint_cli.runs.page_files import PageFiles
from repaint_cli.runs.page_tables import Rows
from repaint_cli.runs.run_command import command_of

PICTURES, TABLE = ("no-difference.png", "no-difference.svg"), "no-difference.csv"

HEADS = ["number", "mean", "95 % lie in", "never"]


def write_report(alike: AgainstItself, folder: Path) -> list[Path]:
    """Write the folder; return its files.

    Raises:
        StoreError: the folder cannot be written.
    """
    for picture in PICTURES:
        draw(alike, folder / picture)
    write_text(folder / TABLE, _csv(alike))
    _page(alike, folder / PAGE)
    return report_files(folder)


def report_files(folder: Path) -> list[Path]:
    """Return the files of a report."""
    return [folder / name for name in (PAGE, *PICTURES, TABLE)]


def rows_of(alike: AgainstItself) -> Rows:
    """Return what each number is without a difference, under `HEADS`."""
    return [[spread.name, *spread.in_words] for spread in alike.spreads]


def false_alarms_of(alike: AgainstItself) -> str:
    """Say how often the area's interval would have seen a difference."""
    share = "no part" if isnan(alike.false_alarms) else f"{alike.false_alarms:.1%}"
    return f"Welch's 95 % interval of the difference in area leaves out 0 in {share} of the splits"


def _page(alike: AgainstItself, page: Path) -> None:
    run, files = alike.run, PageFiles(page)
    runs = {run.label: run}
    caption = f"Two groups of {alike.seeds} seeds of one method, split at random again and again"
    own = Values(
        title=title_of(alike),
        kind="A method against itself, by repaint",
        subtitle=f"{run.task.summary:.300}",
        facts=[("run", str(run.folder)), ("seeds", str(len(run.seeds)))],
        no_difference={
            "caption": caption,
            "heads": HEADS,
            "rows": rows_of(alike),
            "note": f"{false_alarms_of(alike)}.",
            "picture": files.shown(page.with_name(PICTURES[0]), caption + "."),
        },
        films=[],
        pictures_title="Pictures",
        pictures=[],
        settings_title="Settings",
        settings_heads=[],
        settings=[],
        no_settings="Both groups are of one run.",
        commands=[
            {"what": "Make this page:",
             "text": command("repaint compare --aa {} --report {}", run.folder, page.parent)},
            {"what": "Begin such a run:", "text": command_of(run.record, run.task)},
        ],
        versions="",
        files_note=f"The folder has more: {TABLE} with every split, and the figure as PNG and SVG.",
    )  # fmt: skip
    write_page(page, own, runs, comparison_of(runs, None))


def _csv(alike: AgainstItself) -> str:
    """Return a line per split, a column per number; a number that is not there is empty."""
    return csv_text(
        [spread.name for spread in alike.spreads],
        zip(*(spread.values for spread in alike.spreads), strict=True),
    )
