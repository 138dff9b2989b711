"""What `repaint compare` reads and plays."""

import json
from collections.abc import Sequence
from pathlib import Path

from repaint_cli.cli.comparison_table import print_comparison
from repaint_cli.cli.episode_table import table
from repaint_cli.cli.examine import policies
from repaint_cli.cli.screen import out
from repaint_cli.cli.session import say_written
from repaint_cli.errors import CardError, UsageError
from repaint_cli.learn.evaluation import evaluate
from repaint_cli.learn.seeding import Purpose
from repaint_cli.runs import comparison
from repaint_cli.runs.comparison import reference_of
from repaint_cli.runs.comparison_report import title_of, write_report
from repaint_cli.runs.figures import draw_curves, draw_trajectories
from repaint_cli.runs.folder import RunFolder
from repaint_cli.runs.reader import FinishedRun, read_run

EPISODES = 20
"""Episodes that the paper draws of each policy."""


def read_runs(folders: Sequence[Path]) -> dict[str, FinishedRun]:
    """Read runs of one task by labels that tell them apart.

    Other folders, and runs without a finished iteration, are passed over.

    Raises:
        NotFound: there is no such folder.
        CardError: they are of several tasks, or there is none.
    """
    read = _finished(folders)
    tasks = sorted({run.task.name for run in read})
    if len(tasks) != 1:
        raise CardError(f"expected runs of one task, found {', '.join(tasks) or 'no run'}")
    for run in read:
        if part := run.task.difference(read[0].task):
            raise CardError(
                f"expected runs of one task, found other [{part}] settings in {run.folder} "
                f"than in {read[0].folder}"
            )
    labels = [run.label for run in read]
    return {run.label if labels.count(run.label) == 1 else str(run.folder): run for run in read}


def _finished(folders: Sequence[Path]) -> list[FinishedRun]:
    """Read those folders that are runs with a finished iteration."""
    read = [read_run(f) for f in folders if RunFolder(f).is_run() or not f.is_dir()]
    return [run for run in read if run.returns.size]


def compare(
    folders: Sequence[Path],
    reference: str,
    target: float | None,
    picture: Path | None,
    report: Path | None,
    as_json: bool,
) -> None:
    """Compare runs of one task: print, draw, and write a report where one is asked for.

    Raises:
        NotFound: there is no such folder or reference.
        CardError: they are of several tasks, or there is none.
    """
    runs = read_runs(folders)
    found = comparison.compare(runs, reference_of(runs, reference), target)
    if as_json:
        rows = [comparison.as_row(standing) for standing in found.standings]
        told = {"task": found.task, "target": found.target, "reference": found.reference}
        print(json.dumps(told | {"iterations": found.iterations, "runs": rows}, indent=2))
    else:
        print_comparison(found)
    if report:
        written = write_report(runs, found, report)
    else:
        written = [picture or Path("compare.png")]
        draw_curves(runs, written[0], title_of(found), found.target)
    if not as_json:
        say_written(written, "repaint transfer --help")


def check_reference(reference: str | None, folders: Sequence[Path], methods: str) -> None:
    """Check, before anything is trained, that there will be such a reference.

    Raises:
        NotFound: there is no such folder.
        UsageError: there will be none.
        CardError: the folders hold no runs of one task.
    """
    runs = read_runs(folders) if folders else {}
    if reference is None or reference in methods.split(","):
        return
    if not runs or reference_of(runs, reference) is None:
        raise UsageError(f"expected --reference among what is compared, found '{reference}'")


def play(folders: Sequence[Path], picture: Path, as_json: bool) -> None:
    """Let the last policies of runs play, and draw the first seeds' paths side by side.

    Raises:
        NotFound: there is no such folder.
        CardError: there is no run, they drive on several tracks, or their task has no paths.
    """
    runs = _finished(folders)
    if not runs or len({run.task.env.place for run in runs}) > 1:
        found = ", ".join(sorted({run.task.env.place for run in runs})) or "no run"
        raise CardError(f"expected runs on one track or in one environment, found {found}")
    if not runs[0].task.env.has_paths:
        raise CardError(f"expected a task with paths to draw, found '{runs[0].task.name}'")
    panels, told = [], []
    for run in runs:
        seeds = run.seeds
        played = evaluate(policies(run), run.task, seeds, EPISODES, purpose=Purpose.SCORE)
        panels.append((f"{run.task.name}: {run.label}", played))
        told.append({"run": str(run.folder), "task": run.task.name, "label": run.label})
        told[-1] |= {"returns": played.returns.tolist()} | run.task.env.outcomes(played)
        if not as_json:
            out.print(table(panels[-1][0], seeds, run.task.env, played))
    title = f"the last policies, {EPISODES} episodes each, first seeds"
    draw_trajectories(runs[0].task, panels, picture, title)
    if as_json:
        print(json.dumps(told, indent=2))
    else:
        say_written([picture], "repaint compare --help")
