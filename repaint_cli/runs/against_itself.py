"""One method against itself: what every number of a comparison is without any difference."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from repaint_cli.errors import CardError, UsageError
from repaint_cli.files.foreign import check_replaceable
from repaint_cli.report import no_difference
from repaint_cli.report.arrivals import restricted, usual_targets
from repaint_cli.report.distributions import plot_distributions
from repaint_cli.report.statistics import Floats, area_by_steps, area_under_curve, iterations_to
from repaint_cli.runs.comparison_rows import plain
from repaint_cli.runs.reader import RecordedRun, read_run

PICTURE = "no-difference.png"
"""What is drawn where no name is given."""

SHARES = (0.5, 0.9)
"""Of the converged score: the targets whose K is looked at."""


@dataclass(frozen=True)
class Spread:
    """What one number is, again and again, between two groups of seeds of one method."""

    name: str
    values: Floats
    """Of each pair of groups, (R,); nan where there is none."""
    null: float
    """What it is of two groups that are the same."""
    form: str = ".3g"
    """How it is written."""

    @property
    def never(self) -> float:
        """In which share of the pairs there is no value."""
        return no_difference.never(self.values)

    @property
    def middle_and_ends(self) -> tuple[float, float, float]:
        """The mean, and between which ends 95 % of the values lie."""
        return no_difference.middle_and_ends(self.values)

    @property
    def in_words(self) -> tuple[str, str, str]:
        """The mean, where 95 % of the values lie, and in which share there is none, if any."""
        mean, low, high = self.middle_and_ends
        if np.isnan(mean):
            return "-", "-", f"{self.never:.0%}"
        ends = f"[{low:{self.form}}, {high:{self.form}}]"
        return f"{mean:{self.form}}", ends, f"{self.never:.0%}" if self.never else ""

    def as_json(self) -> dict[str, object]:
        """Return it as JSON, without the single values."""
        mean, low, high = map(plain, self.middle_and_ends)
        named = {"mean": mean, "low": low, "high": high, "never": self.never}
        return {"what": self.name, "null": self.null} | named


@dataclass(frozen=True)
class AgainstItself:
    """A run whose seeds are split into two groups in many random ways."""

    run: RecordedRun
    seeds: int
    """Of a group."""
    spreads: tuple[Spread, ...]
    false_alarms: float
    """In which share of the pairs Welch's 95 % interval of the area's difference leaves out 0."""

    def as_json(self) -> dict[str, object]:
        """Return all of it as JSON."""
        return {
            "task": self.run.task.name,
            "run": str(self.run.folder),
            "method": self.run.label,
            "seeds": len(self.run.seeds),
            "seeds_of_a_group": self.seeds,
            "splits": no_difference.DRAWS,
            "false_alarms": plain(self.false_alarms),
            "numbers": [spread.as_json() for spread in self.spreads],
        }


OnSpreads = Callable[[AgainstItself], object]
"""Is called with the numbers before anything is written."""


def check_seeds(n_seeds: int) -> None:
    """Check that there are seeds for two groups.

    Raises:
        UsageError: there are fewer than four.
    """
    if n_seeds < no_difference.LEAST_SEEDS:
        raise UsageError(
            f"expected at least {no_difference.LEAST_SEEDS} seeds for --aa, two groups of two, "
            f"found {n_seeds}"
        )


def read_for_itself(folder: Path) -> RecordedRun:
    """Read a run that is compared with itself.

    Raises:
        NotFound: there is no such run.
        CardError: it has no finished iteration.
        UsageError: it has fewer than four seeds.
    """
    run = read_run(folder)
    if not run.returns.size:
        raise CardError(f"expected a run with a finished iteration, found none in {folder}")
    check_seeds(len(run.seeds))
    return run


def against_itself(run: RecordedRun) -> AgainstItself:
    """Split a run's seeds into two groups in many random ways, and compare these as two runs."""
    returns, steps = run.returns, run.rows["env_steps"]
    groups = no_difference.halves(len(returns))
    area = area_under_curve(returns)
    common = float(steps[:, 0].max()), float(steps[:, -1].min())
    values = {
        "difference in area": area,
        "difference in area by steps": area_by_steps(returns, steps, *common),
        "difference in the last evaluation": returns[:, -1],
    }
    for share, target in usual_targets(returns).items():
        if share in SHARES:
            needed = restricted(iterations_to(returns, target), returns.shape[1])
            values[f"difference in K to {share:.0%}, iterations"] = needed
    spreads = [Spread(name, no_difference.gaps(each, groups), 0) for name, each in values.items()]
    better = Spread("P(X > Y) of the area", no_difference.chances(area, groups), 0.5)
    reduced = no_difference.reductions(returns, groups)
    paper = Spread("K reduced, the paper's measure", reduced, 0, ".0%")
    return AgainstItself(
        run, groups.shape[2], (*spreads, better, paper), no_difference.false_alarms(area, groups)
    )


def draw(alike: AgainstItself, path: Path) -> None:
    """Draw the distributions.

    Raises:
        StoreError: the file cannot be written.
    """
    shown = {}
    for spread in alike.spreads:
        mean, ends, never = spread.in_words
        remark = f"mean {mean}, 95 % in {ends}" + (f"; never in {never}" if never else "")
        shown[spread.name] = (spread.values, spread.null, remark, "%" in spread.form)
    note = "dashed: two groups that are the same; shaded: the middle 95 %"
    plot_distributions(shown, path, title=title_of(alike), note=note)


def title_of(alike: AgainstItself) -> str:
    """Return the title of a figure or a page."""
    run = alike.run
    return f"{run.task.name}: {run.label} against itself, {alike.seeds} seeds and {alike.seeds}"


def check_places(picture: Path | None, report: Path | None, *, replace: bool = False) -> None:
    """Check that what will be written replaces only what repaint wrote, or what it may.

    Raises:
        StoreError: a file is there that repaint did not write.
    """
    from repaint_cli.runs.against_itself_report import report_files

    check_replaceable(report_files(report) if report else [picture or Path(PICTURE)], replace)


def compare_with_itself(
    folder: Path,
    picture: Path | None = None,
    report: Path | None = None,
    on_spreads: OnSpreads | None = None,
    *,
    replace: bool = False,
) -> tuple[AgainstItself, list[Path]]:
    """Compare a run with itself and draw it, or write a report; return the files, too.

    Raises:
        As `read_for_itself`; StoreError: a file cannot be written, or is one that repaint did not
            write.
    """
    from repaint_cli.runs.against_itself_report import write_report

    check_places(picture, report, replace=replace)
    alike = against_itself(read_for_itself(folder))
    if on_spreads:
        on_spreads(alike)
    if report:
        return alike, write_report(alike, report)
    picture = picture or Path(PICTURE)
    draw(alike, picture)
    return alike, [picture]
