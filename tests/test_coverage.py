"""How often the 95 % intervals of a comparison hold the truth, with few seeds and many."""

from pathlib import Path

import interval_coverage
import numpy as np
import pytest

from repaint_cli.report.coverage import GROUPS, PAIRS, coverage_of
from repaint_cli.report.pairs import better, welch_interval
from repaint_cli.report.statistics import t_interval

ROOT = Path(__file__).parents[1]
N = (5, 10, 20)
LAWS = {
    "normal": (lambda rng, shape: rng.normal(0, 1, shape), 0.0),
    "log-normal": (lambda rng, shape: rng.lognormal(0, 1, shape), np.exp(0.5)),
}


def share(low, high, value):
    return ((low <= value) & (value <= high)).mean()


@pytest.mark.parametrize("n", N)
@pytest.mark.parametrize(("law", "least"), [("normal", 0.94), ("log-normal", 0.94)])
def test_two_methods_that_are_alike_differ_by_nothing_in_95_of_100(law, least, n):
    draw, _ = LAWS[law]
    rng = np.random.default_rng(n)
    own, basis = draw(rng, (20_000, n)), draw(rng, (20_000, n))
    _, low, high = t_interval((own - basis).T)
    assert least < share(low, high, 0) < 0.99
    _, low, high = welch_interval(own, basis)
    assert least < share(low, high, 0) < 0.99


@pytest.mark.parametrize("n", N)
@pytest.mark.parametrize(("law", "least"), [("normal", 0.94), ("log-normal", 0.90)])
def test_a_method_with_a_long_tail_is_told_apart_as_it_is(law, least, n):
    draw, mean = LAWS[law]
    rng = np.random.default_rng(n)
    own, basis = draw(rng, (20_000, n)), rng.normal(0, 1, (20_000, n))
    _, low, high = t_interval((own - basis).T)
    assert least < share(low, high, mean) < 0.99


@pytest.mark.parametrize("n", N)
def test_the_chance_to_be_better_lies_in_its_interval(n):
    rng = np.random.default_rng(n)
    held = []
    for _ in range(600):
        _, low, high = better(rng.lognormal(0, 1, n), rng.lognormal(0, 1, n))
        held.append(low <= 0.5 <= high)
    assert np.mean(held) > 0.93


def test_a_bootstrap_of_three_seeds_would_hold_it_in_75_of_100():
    (row,) = [
        row for row in interval_coverage.kept()
        if (row["interval"], row["law"], row["seeds"]) == ("mean, by bootstrap", "normal", "3")
    ]  # fmt: skip
    assert float(row["coverage"]) < 0.8


def test_what_is_said_of_coverage_is_what_was_simulated():
    for kind, table in (("pairs", PAIRS), ("groups", GROUPS)):
        kept = [
            row for row in interval_coverage.kept() if row["interval"] == f"difference of {kind}"
        ]
        for law in ("normal", "skewed"):
            simulated = {int(r["seeds"]): float(r["coverage"]) for r in kept if r["law"] == law}
            stated = {n: getattr(one, law) for n, one in table.items()}
            assert {n: round(100 * value) for n, value in simulated.items()} == stated
    assert coverage_of(3) == PAIRS[3]
    assert coverage_of(9) == PAIRS[7]
    assert coverage_of(1000) == PAIRS[20]
    assert coverage_of(4, paired=False) == GROUPS[4] != PAIRS[4]


def test_the_simulation_can_be_repeated():
    value = interval_coverage.truth("mean", interval_coverage.normal)
    assert value == pytest.approx(0, abs=0.002)
    share = interval_coverage.held("mean", interval_coverage.normal, 3, value)
    assert share == pytest.approx(0.95, abs=0.01)


def test_the_pages_table_is_what_was_simulated():
    page = (ROOT / "docs/comparing.md").read_text(encoding="utf-8")
    for line in interval_coverage.markdown(interval_coverage.kept()):
        assert line in page
