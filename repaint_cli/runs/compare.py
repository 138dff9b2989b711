"""Compare runs: by their returns, or by the paths of their last policies."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from repaint_cli.envs.episodes import Episodes
from repaint_cli.errors import CardError, UsageError, some
from repaint_cli.files.foreign import check_replaceable
from repaint_cli.learn.evaluation import evaluate
from repaint_cli.learn.seeding import Purpose
from repaint_cli.runs.comparison import REFERENCE, Comparison, comparison_of, reference_of
from repaint_cli.runs.comparison_report import report_files, title_of, write_report
from repaint_cli.runs.figures import draw_curves, draw_trajectories
from repaint_cli.runs.find_policies import last_policies
from repaint_cli.runs.folder import RunFolder
from repaint_cli.runs.labels import labels_of
from repaint_cli.runs.reader import RecordedRun, read_run

PICTURE, PATHS_PICTURE = "compare.png", "compare-trajectories.png"
"""What is drawn where no name is given."""

EPISODES = 20
"""Episodes that the paper draws of each policy."""


@dataclass(frozen=True)
class ComparedRuns:
    """Runs of one task, compared."""

    runs: dict[str, RecordedRun]
    """By labels that tell them apart."""
    comparison: Comparison
    """How each did."""
    written: list[Path]
    """The figure, or the files of the report."""


@dataclass(frozen=True)
class EvaluatedRun:
    """A run whose last policies were evaluated."""

    run: RecordedRun
    """Which."""
    label: str
    """Its task and the run's label."""
    episodes: Episodes
    """How they did."""

    def as_json(self) -> dict[str, Any]:
        """Return which run it is and how it did, as JSON."""
        run, returns = self.run, self.episodes.returns.tolist()
        named = {"run": str(run.folder), "task": run.task.name, "label": run.label}
        return named | {"returns": returns} | run.task.env.outcomes(self.episodes)


OnComparison = Callable[[Comparison], object]
"""Is called with the numbers before anything is written."""

OnEvaluatedRun = Callable[[EvaluatedRun], object]
"""Is called with each run as it was evaluated, before anything is written."""


def compare_runs(
    folders: Sequence[Path],
    reference: str | Path | None = None,
    target: float | Sequence[float] | None = None,
    picture: str | Path | None = None,
    report: str | Path | None = None,
    on_comparison: OnComparison | None = None,
    replace: bool = False,
) -> ComparedRuns:
    """Compare runs of one task, and draw their curves or write a report; see `repaint_cli.compare`.

    Raises:
        NotFound: there is no such folder or reference.
        CardError: the runs are of several tasks, or there is no run.
        StoreError: a file cannot be written, or one is there that repaint did not write.
    """
    check_places(picture, report, replace=replace)
    runs = read_runs(folders)
    targets = () if target is None else target if isinstance(target, Sequence) else (target,)
    comparison = comparison_of(runs, reference_of(runs, str(reference or REFERENCE)), targets)
    if on_comparison:
        on_comparison(comparison)
    if report:
        return ComparedRuns(runs, comparison, write_report(runs, comparison, Path(report)))
    picture = Path(picture or PICTURE)
    draw_curves(runs, picture, title_of(comparison), comparison.target)
    return ComparedRuns(runs, comparison, [picture])


def check_places(
    picture: str | Path | None,
    report: str | Path | None,
    *,
    paths: bool = False,
    replace: bool = False,
) -> None:
    """Check that what will be written replaces only what repaint wrote, or what it may.

    Args:
        picture: of the curves or paths.
        report: the folder that is written in its place.
        paths: whether paths are drawn.
        replace: whether other files may be replaced.

    Raises:
        StoreError: a file is there that repaint did not write.
    """
    picture = Path(picture or (PATHS_PICTURE if paths else PICTURE))
    check_replaceable(report_files(Path(report)) if report else [picture], replace)


def read_runs(folders: Sequence[Path]) -> dict[str, RecordedRun]:
    """Read runs of one task by labels that tell them apart.

    Other folders, and runs without a finished iteration, are passed over.

    Raises:
        NotFound: there is no such folder.
        CardError: the runs are of several tasks, or there is no run.
    """
    runs = _with_iterations(folders)
    tasks = sorted({run.task.name for run in runs})
    if len(tasks) != 1:
        raise CardError(f"expected runs of one task, found {some(tasks) or 'no run'}")
    for run in runs:
        if part := run.task.difference(runs[0].task):
            raise CardError(
                f"expected runs of one task, found other [{part}] settings in {run.folder} "
                f"than in {runs[0].folder}"
            )
    return dict(zip(labels_of(runs), runs, strict=True))


def _with_iterations(folders: Sequence[Path]) -> list[RecordedRun]:
    """Read those folders that are runs with a finished iteration."""
    runs = [read_run(f) for f in folders if RunFolder(f).is_run() or not f.is_dir()]
    return [run for run in runs if run.returns.size]


def check_reference(reference: str | None, folders: Sequence[Path], methods: Sequence[str]) -> None:
    """Check, before methods are trained, that there will be such a reference.

    Raises:
        NotFound: there is no such folder.
        UsageError: there will be no such reference.
        CardError: the folders hold no runs of one task.
    """
    runs = read_runs(folders) if folders else {}
    if reference is None or reference in methods:
        return
    if not runs or reference_of(runs, reference) is None:
        raise UsageError(f"expected --reference among what is compared, found '{reference}'")


def compare_paths(
    folders: Sequence[Path],
    picture: Path,
    on_run: OnEvaluatedRun | None = None,
    replace: bool = False,
    episodes: int = EPISODES,
) -> list[EvaluatedRun]:
    """Let the last policies of runs play, and draw the first seeds' paths side by side.

    Raises:
        NotFound: there is no such folder.
        CardError: there is no run, the runs are of several places, or their tasks have no paths.
        StoreError: the picture cannot be written, or replaces what repaint did not write.
    """
    check_replaceable([picture], replace)
    runs = _with_iterations(folders)
    places = sorted({run.task.env.place for run in runs})
    if len(places) != 1:
        named = some(places) or "no run"
        raise CardError(f"expected runs on one track or in one environment, found {named}")
    if runs[0].task.env.paths is None:
        raise CardError(f"expected a task with paths to draw, found '{runs[0].task.name}'")
    evaluated = []
    for run in runs:
        policies = last_policies(run)
        played = evaluate(policies, run.task, run.seeds, episodes, purpose=Purpose.SCORE)
        evaluated.append(EvaluatedRun(run, f"{run.task.name}: {run.label}", played))
        if on_run:
            on_run(evaluated[-1])
    title = (
        f"the last policies, {evaluated[0].episodes.returns.shape[1]} episodes each, first seeds"
    )
    panels = [(one.label, one.episodes) for one in evaluated]
    draw_trajectories(runs[0].task, panels, picture, title)
    return evaluated
