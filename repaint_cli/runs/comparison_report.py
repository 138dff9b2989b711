"""A comparison as a folder that stands alone: a page, its numbers, and figures for print."""

from collections.abc import Mapping
from pathlib import Path

from repaint_cli.files.atomic import write_text
from repaint_cli.report.profiles import plot_profiles
from repaint_cli.report.statistics import t_interval
from repaint_cli.report.targets import plot_targets
from repaint_cli.runs.comparison import REFERENCE, Comparison, reference_of
from repaint_cli.runs.comparison_rows import COLUMNS, TARGET_COLUMNS, as_row, csv_text, target_rows
from repaint_cli.runs.figures import draw_curves
from repaint_cli.runs.folder import PAGE
from repaint_cli.runs.page import Values, write_page
from repaint_cli.runs.page_files import PageFiles, pictures_of
from repaint_cli.runs.reader import RecordedRun
from repaint_cli.runs.run_command import command_of, compare_command
from repaint_cli.runs.settings_shown import differing_settings

FIGURES = ("curves", "targets", "profiles")
PICTURES = tuple(f"{name}.{kind}" for name in FIGURES for kind in ("png", "svg"))
TABLES = ("comparison.csv", "targets.csv", "curves.csv")


TARGETS_CAPTION = "How many iterations a seed needed to any target; lower is earlier."
PROFILES_CAPTION = "Performance profiles: the share of seeds that ended at or above a score."


def write_report(
    runs: Mapping[str, RecordedRun], comparison: Comparison, folder: Path
) -> list[Path]:
    """Write the folder; return its files.

    Raises:
        CheckpointError: the alarms of a run are damaged.
        StoreError: the folder cannot be written.
    """
    for picture in PICTURES:
        _draw(runs, comparison, folder / picture)
    texts = _comparison(comparison), _targets(comparison), _curves(runs)
    for name, text in zip(TABLES, texts, strict=True):
        write_text(folder / name, text)
    _page(runs, comparison, folder / PAGE)
    return report_files(folder)


def _draw(runs: Mapping[str, RecordedRun], comparison: Comparison, path: Path) -> None:
    """Draw one of the figures, which the name of its file tells."""
    title, standings = title_of(comparison), comparison.standings
    if path.stem == "curves":
        draw_curves(runs, path, title, comparison.target)
    elif path.stem == "profiles":
        plot_profiles({row.label: row.final_each for row in standings}, path, title=title)
    else:
        marks = {
            arrivals.target: "target" if arrivals.share is None else f"{arrivals.share:.0%}"
            for arrivals in standings[0].targets
        }
        parts = {label: run.until(comparison.iterations).returns for label, run in runs.items()}
        plot_targets(parts, marks, path, title=title)


def report_files(folder: Path) -> list[Path]:
    """Return the files of a report."""
    return [folder / name for name in (PAGE, *PICTURES, *TABLES)]


def report_command(runs: Mapping[str, RecordedRun], comparison: Comparison, folder: Path) -> str:
    """Return the command that writes the report of a comparison."""
    usual = comparison.reference in (None, reference_of(runs, REFERENCE))
    basis = None if usual else runs[str(comparison.reference)].folder
    return compare_command([run.folder for run in runs.values()], basis, comparison.given, folder)


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
            ("target of the paper's measure", comparison.goal),
            ("compared over", f"the first {comparison.iterations} iterations"),
            *([("warning", warning)] if (warning := comparison.warning()) else []),
        ],
        targets_picture=files.shown(page.with_name("targets.png"), TARGETS_CAPTION),
        profiles_picture=files.shown(page.with_name("profiles.png"), PROFILES_CAPTION),
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
        files_note="The folder has more: comparison.csv and targets.csv with the numbers, "
        "curves.csv with every point, and every figure as PNG and SVG.",
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
    return csv_text(COLUMNS, ([row[name] for name in COLUMNS] for row in rows))


def _targets(comparison: Comparison) -> str:
    rows = [row for standing in comparison.standings for row in target_rows(standing)]
    return csv_text(TARGET_COLUMNS, ([row[name] for name in TARGET_COLUMNS] for row in rows))


def _curves(runs: Mapping[str, RecordedRun]) -> str:
    lines = []
    for label, run in runs.items():
        _, low, high = t_interval(run.returns)
        for k in range(run.returns.shape[1]):
            each = run.returns[:, k]
            numbers = [each.mean(), low[k], high[k], run.rows["env_steps"][:, k].mean()]
            seeds = " ".join(f"{value:.6g}" for value in each)
            lines.append([label, k + 1, *numbers, seeds])
    return csv_text(("run", "iteration", "mean", "low", "high", "env_steps", "each_seed"), lines)
