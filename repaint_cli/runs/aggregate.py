"""Several pairs of task and teacher in one: a method's runs, and its references', together."""

from collections.abc import Sequence
from dataclasses import dataclass

from repaint_cli.errors import UsageError
from repaint_cli.report import aggregates
from repaint_cli.report.statistics import Estimate, Floats, area_under_curve
from repaint_cli.runs.comparison_rows import plain
from repaint_cli.runs.reader import RecordedRun


@dataclass(frozen=True)
class Pair:
    """A run and the reference on the same task."""

    name: str
    """Of the task and the teacher."""
    run: RecordedRun
    reference: RecordedRun


@dataclass(frozen=True)
class Aggregated:
    """A method over several pairs; scores are 0 at the reference's beginning and 1 at its end."""

    pairs: tuple[str, ...]
    seeds: int
    """Of all pairs."""
    of_what: str
    numbers: dict[str, Estimate]
    """Of the method, by the names in `aggregates.AGGREGATES`."""
    reference: dict[str, Estimate]
    """Of the references."""
    improvement: Estimate
    """The probability that a seed is above one of the reference, mean over pairs."""

    def as_json(self) -> dict[str, object]:
        """Return it as JSON."""
        return {
            "pairs": list(self.pairs),
            "seeds": self.seeds,
            "of": self.of_what,
            "method": {name: _row(number) for name, number in self.numbers.items()},
            "reference": {name: _row(number) for name, number in self.reference.items()},
            "probability_of_improvement": _row(self.improvement),
        }


def aggregated(pairs: Sequence[Pair], of_what: str = "area") -> Aggregated:
    """Return a method's numbers over several pairs, with a bootstrap within each pair.

    Args:
        pairs: of runs; both of a pair are looked at over the iterations that both have.
        of_what: "area", the mean return, or "final", the last evaluation.

    Raises:
        UsageError: there is no pair, or a reference ended no higher than it began, so that nothing
            can be measured by it.
    """
    if not pairs:
        raise UsageError("expected at least one pair of runs, found none")
    scores = [_scores(pair, pair.run, of_what) for pair in pairs]
    others = [_scores(pair, pair.reference, of_what) for pair in pairs]
    interval = aggregates.interval_of
    return Aggregated(
        pairs=tuple(pair.name for pair in pairs), seeds=sum(map(len, scores)), of_what=of_what,
        numbers={name: interval(each, scores) for name, each in aggregates.AGGREGATES.items()},
        reference={name: interval(each, others) for name, each in aggregates.AGGREGATES.items()},
        improvement=aggregates.improvement(scores, others),
    )  # fmt: skip


def _scores(pair: Pair, run: RecordedRun, of_what: str) -> Floats:
    """Return the normalised scores of a run's seeds, (S,)."""
    common = min(pair.run.returns.shape[1], pair.reference.returns.shape[1])
    returns, reference = run.until(common).returns, pair.reference.until(common).returns
    values = area_under_curve(returns) if of_what == "area" else returns[:, -1]
    try:
        return aggregates.normalised(values, reference)
    except ValueError as error:
        raise UsageError(f"{pair.name}: {error}") from error


def _row(number: Estimate) -> list[object]:
    return [plain(value) for value in number]
