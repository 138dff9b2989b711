"""How a variant of an experiment compares with scratch, in numbers that goals are set in."""

from collections.abc import Iterator

from repaint_cli.experiments.results import MeasuredPanel
from repaint_cli.report.pairs import better, difference
from repaint_cli.report.statistics import (
    Estimate,
    Floats,
    area_by_steps,
    area_under_curve,
    bootstrap_mean,
)
from repaint_cli.runs.comparison import REFERENCE
from repaint_cli.runs.reader import RecordedRun

FIRST_STEPS = {"judge-lanes": 20_000, "judge-more-lanes": 20_000, "judge-traffic": 15_000}
"""Environment steps in the beginning that goals are about, by experiment."""

HEADS = ("panel", "variant", "area − scratch's", "in %", "P(better)", "first steps", "last")
MEANING = (
    "area − scratch's: pair by pair of seeds; in %: of the size of scratch's mean area; first "
    "steps: the same % over the first {steps:,} environment steps, from the first evaluation that "
    "all have, teachers' steps counted; last: the last evaluation, paired difference; in square "
    "brackets 95 %: t intervals, of percentages a bootstrap over pairs"
)


def lines(panels: list[MeasuredPanel]) -> Iterator[str]:
    """Yield the lines of a table, a row for each variant beside scratch; none without scratch."""
    steps = FIRST_STEPS.get(panels[0].experiment, 0)
    rows = [row for panel in panels for row in _rows(panel, steps)]
    if rows:
        yield f"| {' | '.join(HEADS)} |"
        yield "|---|---|" + "---:|" * (len(HEADS) - 2)
        yield from (f"| {' | '.join(row)} |" for row in rows)


def meaning(panels: list[MeasuredPanel]) -> str:
    """Return what the columns mean."""
    steps = FIRST_STEPS.get(panels[0].experiment, 0)
    text = MEANING.format(steps=steps)
    before, _, after = text.partition("first steps")
    return text if steps else before + after[after.index("last:") :]


def _rows(panel: MeasuredPanel, steps: int) -> Iterator[list[str]]:
    scratch = panel.runs.get(REFERENCE)
    if scratch is None:
        return
    for name, run in panel.runs.items():
        if run is scratch:
            continue
        k = min(run.returns.shape[1], scratch.returns.shape[1])
        own, basis = (area_under_curve(one.returns[:, :k]) for one in (run, scratch))
        last = difference(
            run.returns[:, k - 1], scratch.returns[:, k - 1], run.seeds, scratch.seeds
        )
        first = _of_first_steps(run, scratch, steps) if steps else "-"
        yield [
            panel.panel.title, name,
            _text(difference(own, basis, run.seeds, scratch.seeds).mean),
            _share(own, basis), _text(better(own, basis), sign=""), first, _text(last.mean),
        ]  # fmt: skip


def _of_first_steps(run: RecordedRun, scratch: RecordedRun, steps: int) -> str:
    low = max(one.rows["env_steps"][:, 0].max() for one in (run, scratch))
    areas = [
        area_by_steps(one.returns, one.rows["env_steps"], low, steps) for one in (run, scratch)
    ]
    return _share(*areas)


def _share(own: Floats, basis: Floats) -> str:
    """Return the difference of two means in % of the second's size, with a bootstrap over pairs."""
    gaps = 100 * (own - basis) / abs(basis.mean())
    low, high = bootstrap_mean(gaps[:, None])
    return f"{gaps.mean():+.0f} [{low[0]:+.0f}, {high[0]:+.0f}]"


def _text(number: Estimate, sign: str = "+") -> str:
    mean, low, high = number
    return f"{mean:{sign}.3g} [{low:{sign}.3g}, {high:{sign}.3g}]"
