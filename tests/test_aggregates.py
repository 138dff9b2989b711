"""Aggregates over pairs of task and teacher, held to rliable's."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose
from written_runs import climb, write_run

from repaint_cli.errors import UsageError
from repaint_cli.report import aggregates
from repaint_cli.report.statistics import area_under_curve
from repaint_cli.runs.aggregate import Pair, aggregated


def scores(seed, n_seeds=(6, 6, 6)):
    """Scores of some pairs, of different heights."""
    rng = np.random.default_rng(seed)
    return [rng.normal(0.5 + 0.3 * i, 0.4, n) for i, n in enumerate(n_seeds)]


def test_scores_are_shares_of_the_way_that_the_reference_went():
    reference = [[-10.0] + [-4.0] * 9, [-12.0] + [-4.0] * 9]
    assert_allclose(aggregates.normalised([-11.0, -4.0, -7.5, 3.0], reference), [0, 1, 0.5, 2])
    with pytest.raises(
        ValueError, match="a reference that learned, found one that ended no higher"
    ):
        aggregates.normalised([1.0], [[3.0, 3.0]])


def test_aggregates_by_hand():
    two = [np.array([0.0, 1.0, 2.0]), np.array([3.0])]
    assert aggregates.mean(two) == 2.0  # each pair counts as much
    assert aggregates.interquartile_mean(two) == 1.5
    assert aggregates.optimality_gap(two) == pytest.approx(1 - (2 / 3 + 1) / 2)
    others = [np.array([1.0]), np.array([0.0])]
    assert aggregates.probability_of_improvement(two, others) == pytest.approx((0.5 + 1) / 2)


def test_seeds_are_drawn_within_their_pair():
    apart = [np.array([0.0, 0.0, 0.0]), np.array([8.0, 8.0])]
    assert aggregates.interval_of(aggregates.mean, apart) == (4, 4, 4)
    assert aggregates.improvement(apart, apart) == (0.5, 0.5, 0.5)


def test_more_seeds_are_a_narrower_interval_and_it_is_the_same_again():
    few, many = scores(1), scores(1, (60, 60, 60))
    _, low, high = aggregates.interval_of(aggregates.interquartile_mean, few)
    _, lower, higher = aggregates.interval_of(aggregates.interquartile_mean, many)
    assert higher - lower < 0.8 * (high - low)
    again = aggregates.interval_of(aggregates.interquartile_mean, few)
    assert again[1:] == (low, high)


@pytest.fixture
def library(monkeypatch):
    """rliable's metrics and library, of the extra dev."""
    pytest.importorskip("rliable", reason="needs rliable, of the extra dev")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MPLBACKEND", "agg")
        from rliable import library, metrics
    return library, metrics


def test_numbers_are_those_of_rliable(library):
    _, metrics = library
    matrix, others = np.stack(scores(3), axis=1), np.stack(scores(4), axis=1)  # (runs, tasks)
    own, basis = list(matrix.T), list(others.T)
    assert aggregates.interquartile_mean(own) == pytest.approx(metrics.aggregate_iqm(matrix))
    assert aggregates.mean(own) == pytest.approx(metrics.aggregate_mean(matrix))
    gap = metrics.aggregate_optimality_gap(matrix, 1.0)
    assert aggregates.optimality_gap(own) == pytest.approx(gap)
    improvement = metrics.probability_of_improvement(matrix, others)
    assert aggregates.probability_of_improvement(own, basis) == pytest.approx(improvement)


def test_intervals_are_those_of_rliable(library):
    library, metrics = library
    matrix, others = np.stack(scores(3), axis=1), np.stack(scores(4), axis=1)
    cases = {
        "iqm": (metrics.aggregate_iqm, aggregates.interquartile_mean),
        "gap": (lambda x: metrics.aggregate_optimality_gap(x, 1.0), aggregates.optimality_gap),
    }
    for theirs, ours in cases.values():
        _, ends = library.get_interval_estimates(
            {"own": matrix}, lambda x, theirs=theirs: np.array([theirs(x)]), reps=2_000
        )
        _, low, high = aggregates.interval_of(ours, list(matrix.T))
        assert_allclose([low, high], ends["own"].ravel(), atol=0.03)
    _, ends = library.get_interval_estimates(
        {"own": (matrix, others)},
        lambda x, y: np.array([metrics.probability_of_improvement(x, y)]),
        reps=500,
    )
    _, low, high = aggregates.improvement(list(matrix.T), list(others.T))
    assert_allclose([low, high], ends["own"].ravel(), atol=0.06)


def test_runs_of_several_pairs_are_one_number(home):
    high = climb(5, speed=2)
    pairs = [
        Pair("gentle", write_run(home / "a", high, "repaint", ["gentle"]),
             write_run(home / "b", climb(4, speed=6))),
        Pair("away", write_run(home / "c", climb(5, 30, 6), "repaint", ["away"]),
             write_run(home / "d", climb(5, speed=6))),
    ]  # fmt: skip
    found = aggregated(pairs)
    assert (found.pairs, found.seeds) == (("gentle", "away"), 10)
    first = pairs[0].reference.returns[:, 0].mean()
    last = pairs[0].reference.returns.mean(0)[-4:].mean()
    score = (area_under_curve(high) - first) / (last - first)
    alone = aggregated(pairs[:1])
    assert alone.numbers["mean"][0] == pytest.approx(score.mean())
    assert alone.improvement[0] == 1
    assert 0.5 < found.improvement[0] < 1
    printed = json.loads(json.dumps(found.as_json(), allow_nan=False))
    assert printed["method"].keys() == {"iqm", "mean", "optimality_gap"}
    assert aggregated(pairs, "final").numbers["mean"][0] == pytest.approx(1, abs=0.2)
    flat = write_run(home / "flat", [[3.0, 3.0]] * 2)
    with pytest.raises(UsageError, match="flat: expected a reference that learned"):
        aggregated([Pair("flat", flat, flat)])
    with pytest.raises(UsageError, match="at least one pair"):
        aggregated([])
