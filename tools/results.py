"""The results of `repaint reproduce` in docs/results.md, from CSVs that are committed.

    python tools/results.py collect reproduce    # copy finished experiments' CSVs from there
    python tools/results.py                      # write the section of docs/results.md from them

What is of the scale smoke is no result and is not collected. A text beside a CSV, with the suffix
.md, stands under its table: why our numbers are others than the paper's, and what was tried.
"""

import shutil
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

import beside_scratch

from repaint_cli.errors import RepaintError, StoreError
from repaint_cli.experiments.estimates import hours_of
from repaint_cli.experiments.files import list_experiments, read_experiment
from repaint_cli.experiments.folder import ExperimentFolder, ExperimentRecord
from repaint_cli.experiments.measures import over_panels, rows_of
from repaint_cli.experiments.results import MeasuredPanel, read_curves
from repaint_cli.experiments.schema import SCALES, Experiment
from repaint_cli.experiments.tables import MEANING, MORE, markdown, over_markdown

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks" / "results" / "reproduce"
OWN = ROOT / "benchmarks" / "transfer"
"""Experiments that are not the paper's: how the plain command was chosen, and what it earns."""
PAGE = ROOT / "docs" / "results.md"
BEGIN, END = "<!-- by tools/results.py -->\n", "<!-- end of tools/results.py -->\n"
WIDTH = 120
"""Of the page's lines, in characters."""
REAL = tuple(scale for scale in SCALES if scale != "smoke")

INTRO = """## The paper's experiments

`repaint reproduce NAME --scale night` or `paper` trains what a figure or table of the paper needs,
draws it, and puts our numbers beside the paper's; `repaint reproduce list` shows them all. The
numbers of training are the paper's (`--preset paper`); seeds, iterations and the camera's network
are those of the scale, in `experiments/*.toml`. `python tools/results.py` wrote this section from
CSVs below `benchmarks/results/`, one for each experiment and scale that was run.
"""

OWN_INTRO = """## The plain command

`repaint transfer --teacher T --task S` decides how to use a teacher by what it measures
([Transfer a teacher](transfer.md)). `judge-…` are what it earns, on seeds that nothing was chosen
on; `choose-…` is what it was chosen among, on others, from 100 on. Numbers of training are those of
the cards; students who are taught to race learn from rollouts of about 750 steps (`ppo.max_steps`),
scratch from the card's 20 episodes. What measuring teachers cost is counted as steps.
"""


def own_experiments() -> list[Experiment]:
    """Return the experiments that are not the paper's, the judging ones first."""
    paths = sorted(OWN.glob("*.toml"), key=lambda path: (path.stem.startswith("choose"), path))
    return [read_experiment(str(path)) for path in paths]


def csv_of(experiment: Experiment, scale: str) -> Path:
    """Return where the curves of an experiment are committed."""
    return RESULTS / f"{experiment.name}.{scale}.csv"


def command_of(experiment: Experiment, scale: str) -> str:
    """Return the command that makes the results of an experiment, wherever it was carried out."""
    name = experiment.name
    if Path(experiment.file).suffix:
        name = f"{OWN.relative_to(ROOT).as_posix()}/{name}.toml"
    return f"repaint reproduce {name} --scale {scale}"


def collect(into: Path) -> Iterator[Path]:
    """Copy the curves and records of finished experiments; yield the CSVs.

    Raises:
        StoreError: a record in a folder of results is of the scale smoke.
    """
    for experiment in (*list_experiments(), *own_experiments()):
        for scale in REAL:
            folder = ExperimentFolder(into / scale / experiment.name)
            if experiment.gathers or not folder.record.is_file():
                continue
            record = ExperimentRecord.read(folder.record)
            if record.scale != scale:
                raise StoreError(f"{folder.path} is of the scale {record.scale}: no result")
            if not record.is_of(experiment):
                print(f"left out, of an earlier definition: {folder.path}", file=sys.stderr)
            elif record.finished:
                path = csv_of(experiment, scale)
                path.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(folder.curves, path)
                shutil.copyfile(folder.record, path.with_suffix(".json"))
                yield path


def section() -> str:
    """Return the section of the page."""
    ours, paper_s = own_experiments(), list_experiments()
    parts = [OWN_INTRO, *_parts(ours), INTRO, *_parts(paper_s)]
    parts.append("\n".join(_not_run([*ours, *paper_s])))
    return "\n".join(parts)


def _parts(experiments: list[Experiment]) -> Iterator[str]:
    """Yield what is on the page of each experiment at each scale."""
    known = {(one.name, scale): panels_at(one, scale) for one in experiments for scale in REAL}
    for one in experiments:
        for scale in reversed(REAL):
            gathered = [panel for name in one.gathers for panel in known.get((name, scale), [])]
            panels = known[one.name, scale] + [panel for panel in gathered if panel.panel.paper]
            if panels:
                yield "\n".join(_part(one, scale, panels))


def panels_at(experiment: Experiment, scale: str) -> list[MeasuredPanel]:
    """Return the panels of an experiment, none where nothing is committed."""
    path = csv_of(experiment, scale)
    return read_curves(path, experiment) if path.is_file() else []


def _part(experiment: Experiment, scale: str, panels: list[MeasuredPanel]) -> Iterator[str]:
    yield f"### {experiment.name}, {scale} ({experiment.item})"
    yield ""
    yield experiment.summary
    if experiment.claim:
        yield textwrap.fill(f"The paper: {experiment.claim}", WIDTH)
    yield ""
    if not experiment.gathers:
        record = ExperimentRecord.read(csv_of(experiment, scale).with_suffix(".json"))
        yield textwrap.fill(
            f"`{command_of(experiment, scale)}`: {record.seeds} seeds × {record.iterations:,} "
            f"iterations, {record.precision}, {record.hours:.1f} hours on {record.hardware}, "
            f"repaint {record.versions.get('repaint-rl', '?')}, {record.date}.",
            WIDTH,
        )
        yield ""
    yield from markdown([row for panel in panels for row in rows_of(panel)], experiment.table)
    yield ""
    if Path(experiment.file).suffix and any("scratch" in panel.runs for panel in panels):
        yield from beside_scratch.lines(panels)
        yield ""
        yield textwrap.fill(f"{beside_scratch.meaning(panels)}.", WIDTH)
        yield ""
    if experiment.table == "iterations":
        yield from over_markdown(over_panels(panels))
        yield ""
    note = csv_of(experiment, scale).with_suffix(".md")
    if note.is_file():
        yield note.read_text(encoding="utf-8")


def _not_run(experiments: list[Experiment]) -> Iterator[str]:
    yield "### What each column is, and what was not run"
    yield ""
    yield textwrap.fill(f"{MEANING}; {MORE}.", WIDTH)
    yield ""
    yield "Not run yet, and about how many hours it takes on two cores, shared runs counted:"
    yield ""
    yield "| experiment | scale | hours | command |"
    yield "|---|---|---:|---|"
    for experiment in experiments:
        for scale in experiment.scale_names:
            if experiment.gathers or scale == "smoke" or csv_of(experiment, scale).is_file():
                continue
            hours, call = hours_of(experiment, scale), command_of(experiment, scale)
            yield f"| {experiment.name} | {scale} | {hours:.1f} | `{call}` |"


def with_section(page: str) -> str:
    """Return a page with the section in its place."""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise StoreError(f"expected the lines {BEGIN.strip()} and {END.strip()} in {PAGE}")
    return f"{before}{BEGIN}{section()}\n{END}{after}"


def main(words: list[str]) -> None:
    """Collect, or write the section."""
    try:
        if words[:1] == ["collect"]:
            for path in collect(Path(words[1])):
                print(path.relative_to(ROOT))
        else:
            PAGE.write_text(with_section(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    except RepaintError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main(sys.argv[1:])
