"""One method against itself: the groups, the numbers, and what the command prints of them."""

import csv
import json

import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_runs import QUICK
from test_page import Page
from written_runs import climb, write_run

from repaint_cli.report import no_difference
from repaint_cli.runs.against_itself import against_itself

NAN = np.nan


def test_halves_are_groups_without_a_common_seed():
    groups = no_difference.halves(7)
    assert groups.shape == (no_difference.DRAWS, 2, 3)
    assert all(len(set(pair.ravel())) == 6 for pair in groups[:50])
    assert set(groups.ravel()) == set(range(7))


def test_numbers_of_groups_by_hand():
    groups = np.array([[[0, 1], [2, 3]], [[0, 2], [1, 3]]])
    values = [1.0, 2.0, 3.0, 5.0]
    assert_allclose(no_difference.gaps(values, groups), [1.5 - 4, 2 - 3.5])
    assert_allclose(no_difference.chances(values, groups), [0, 0.25])
    returns = np.array([[0, 0, 2.0], [0, 2.0, 0], [0, 1.0, 1.0], [0, 1.0, 1.0]])
    # means: [0 1 1] and [0 1 1], whose best is 1, first at 2; then [0 .5 1.5] and [0 1.5 .5]
    assert_allclose(no_difference.reductions(returns, groups), [0, -0.5])
    assert_allclose(no_difference.reductions(returns, groups, 9.0), [NAN, NAN])
    groups = np.array([[[0, 2], [0, 1]], [[0, 1], [1, 3]]])
    # [0 .5 1.5] to the best of [0 1 1]: 3 against 2; [0 1 1] never gets to that of [0 1.5 .5]
    assert_allclose(no_difference.reductions(returns, groups), [-0.5, NAN])


def test_differences_of_groups_spread_as_those_of_two_runs_do():
    values = np.random.default_rng(1).normal(0, 2, 20)
    gaps = no_difference.gaps(values, no_difference.halves(20))
    assert gaps.mean() == pytest.approx(0, abs=0.1)
    assert gaps.std() == pytest.approx(values.std(ddof=1) * np.sqrt(2 / 10), rel=0.05)
    assert 0.02 < no_difference.false_alarms(values, no_difference.halves(20)) < 0.09
    assert np.isnan(no_difference.false_alarms(np.ones(4), no_difference.halves(4)))


def noisy(n_seeds, n_iterations=25):
    """Seeds of one method that climb at different speeds, with noise in each evaluation."""
    rng = np.random.default_rng(5)
    speed = rng.lognormal(1.5, 0.4, (n_seeds, 1))
    curve = -12 + 7 * (1 - np.exp(-np.arange(n_iterations) / speed))
    return curve + rng.normal(0, 0.6, curve.shape)


def test_the_papers_measure_sees_differences_where_there_are_none(home):
    alike = against_itself(write_run(home / "run", noisy(20)))
    assert alike.seeds == 10
    spreads = {spread.name: spread for spread in alike.spreads}
    paper = spreads["K reduced, the paper's measure"]
    assert 0.3 < paper.never < 0.7
    mean, low, high = paper.middle_and_ends
    assert high - low > 0.2
    assert mean > 0  # who arrives at all arrives early: the measure flatters
    mean, low, high = spreads["P(X > Y) of the area"].middle_and_ends
    assert mean == pytest.approx(0.5, abs=0.02)
    assert low < 0.3 < 0.7 < high
    assert spreads["difference in K to 90%, iterations"].never == 0


def test_a_run_is_compared_with_itself(repaint, home):
    write_run(home / "run", noisy(6))
    said = repaint("compare", "run", "--aa")
    assert said.code == 0, said.err
    assert said.out.startswith("reacher: scratch against itself, 3 seeds and 3\n")
    assert max(map(len, said.out.splitlines())) <= 80
    assert "K reduced, the paper's measure" in said.out
    assert (home / "no-difference.png").read_bytes().startswith(b"\x89PNG")
    printed = json.loads(repaint("compare", "run", "--aa", "--json").out)
    assert (printed["seeds"], printed["seeds_of_a_group"]) == (6, 3)
    assert 0 < printed["numbers"][-1]["never"] < 1
    again = json.loads(repaint("compare", "run", "--aa", "--json").out)
    assert again == printed


def test_the_report_of_a_run_against_itself(repaint, home):
    write_run(home / "run", noisy(6))
    assert repaint("compare", "run", "--aa", "--report", "report").code == 0
    names = {"report.html", "no-difference.png", "no-difference.svg", "no-difference.csv"}
    assert {path.name for path in (home / "report").iterdir()} == names
    page = Page(home / "report" / "report.html")
    assert page.tables[0][0] == ["number", "mean", "95 % lie in", "never"]
    assert len(page.tables[0]) == 8
    assert "repaint compare --aa run --report report" in page.words
    with (home / "report" / "no-difference.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == no_difference.DRAWS
    assert "" in {row["K reduced, the paper's measure"] for row in rows}


def test_a_task_is_trained_and_compared_with_itself(repaint, home):
    words = ["compare", "--task", "reacher", "--aa", *QUICK[:2], *QUICK[4:]]
    said = repaint(*words, "--set", "eval.episodes=2", "--seeds", 4)
    assert said.code == 0, said.err
    assert "1 of 1: wrote runs/reacher/compare-" in said.err
    assert "reacher: scratch against itself, 2 seeds and 2" in said.out


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["run"], "expected at least 4 seeds for --aa, two groups of two, found 3"),
        (["--task", "reacher", "--seeds", 3],
         "expected at least 4 seeds for --aa, two groups of two, found 3"),
        (["--task", "reacher", "--methods", "scratch,repaint"],
         "expected one of --methods with --aa, found scratch, repaint"),
        (["run", "run"],
         "expected one RUN with --aa, or --task without RUN; found 2 runs"),
        (["run", "--task", "reacher"],
         "expected one RUN with --aa, or --task without RUN; found 1 run and --task"),
        ([], "expected one RUN with --aa, or --task without RUN; found 0 runs"),
        (["run", "--target", "3"],
         "--target is for figures of returns of several runs; leave it out"),
        (["run", "--reference", "x"],
         "--reference is for figures of returns of several runs; leave it out"),
    ],
)  # fmt: skip
def test_what_cannot_be_compared_with_itself_is_said_in_a_line(repaint, home, words, line):
    write_run(home / "run", climb(3))
    said = repaint("compare", "--aa", *words)
    assert said.code == 2
    assert said.err == f"error: {line}\n"
    assert not (home / "no-difference.png").exists()
