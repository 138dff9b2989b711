"""`repaint compare`: the numbers, the tables, the folder, and the training of several methods."""

import csv
import io
import json
import re
import shlex
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console
from small_runs import QUICK, add_teacher

from repaint_cli.cli import comparison_table
from repaint_cli.errors import NotFound
from repaint_cli.runs import comparison_words
from repaint_cli.runs.comparison import COLUMNS, as_row, comparison_of, reference_of

SCRATCH = ["transfer", "--task", "reacher", "--method", "scratch", *QUICK]


def run(method, *returns, steps=100.0, seconds=2.0):
    """A run that earned these returns, (S, K)."""
    curves = np.array(returns, float)
    k = np.arange(1, curves.shape[1] + 1) * np.ones((len(curves), 1))
    rows = {"eval_return": curves, "env_steps": steps * k, "seconds": seconds * k}
    return SimpleNamespace(
        until=lambda n: run(method, *curves[:, :n], steps=steps, seconds=seconds),
        method=method, label=method, returns=curves, rows=rows,
        task=SimpleNamespace(name="reacher"), folder=Path("runs") / method,
    )  # fmt: skip


SLOW = run("scratch", [0, 1, 2, 3, 4], [0, 1, 2, 3, 4], [0, 1, 2, 3, 4])
QUICKER = run("repaint", [0, 4, 4, 4, 4], [2, 4, 4, 4, 4], [1, 4, 4, 4, 4], steps=200, seconds=1)
LOST = run("instance", [0, 0, 0, 0, 3], [0, 0, 0, 0, 3])


def standings(*runs, target=None):
    compared = comparison_of({r.method: r for r in runs}, "scratch", target)
    return compared, {standing.label: standing for standing in compared.standings}


def test_the_target_is_the_references_best_mean_unless_one_is_given():
    assert standings(SLOW, QUICKER)[0].target == 4
    assert standings(SLOW, QUICKER, target=2.5)[0].target == 2.5
    assert comparison_of({"repaint": QUICKER}, None, None).target is None


def test_to_the_target_by_hand():
    _, rows = standings(SLOW, QUICKER, LOST)
    scratch, repaint, lost = (rows[name] for name in ("scratch", "repaint", "instance"))
    assert (scratch.reached, repaint.reached) == (5, 2)
    assert repaint.reduced == pytest.approx((0.6, 0.6, 0.6))
    assert (repaint.env_steps, repaint.seconds) == (400, 2)
    assert repaint.seconds_reduced == pytest.approx(1 - 2 / 10)
    assert np.isnan([lost.reached, *lost.reduced, lost.env_steps, lost.seconds]).all()
    assert np.isnan(lost.reached_each).all()
    assert np.isnan([*scratch.reduced, scratch.seconds_reduced, scratch.chance]).all()


def test_scores_by_hand():
    _, rows = standings(SLOW, QUICKER)
    repaint = rows["repaint"]
    assert repaint.first[0] == 1
    assert repaint.area[0] == pytest.approx((0.5 * 1 + 4 + 4 + 4 + 0.5 * 4) / 4)
    assert (repaint.best, repaint.final) == (4, (4, 4, 4))
    assert repaint.chance == pytest.approx(2 / 20)


def test_runs_are_compared_over_the_iterations_that_all_have():
    short = run("repaint", [4, 4], [4, 4])
    compared, rows = standings(SLOW, short)
    scratch = rows["scratch"]
    assert compared.iterations == 2
    assert scratch.area[0] == 0.5
    assert (compared.target, scratch.best, scratch.final[0], scratch.reached) == (1, 1, 1, 2)
    assert (scratch.iterations, rows["repaint"].iterations) == (5, 2)
    assert compared.warning() == (
        "repaint has only 2 of 5 iterations: all runs are compared over the first 2"
    )
    assert compared.as_json()["warning"] == compared.warning()
    assert standings(SLOW, QUICKER)[0].warning() is None


@pytest.mark.parametrize(
    ("estimate", "said"),
    [
        ((0.6, 0.5, 0.7), "60% [50%, 70%]"),
        ((-11.13, -14.0, -9.0), "×12.1 [×15, ×10]"),
        ((0.1, -0.5, 0.4), "10% [×1.5, 40%]"),
        ((0.0, np.nan, np.nan), "0%"),
        ((np.nan, np.nan, np.nan), "-"),
    ],
)
def test_who_is_later_is_no_percentage(estimate, said):
    assert comparison_words.reduction(estimate) == said


def test_of_many_seeds_the_ends_are_named():
    assert comparison_words.each_seed([3, np.nan, 12]) == "3, never, 12"
    assert comparison_words.each_seed([3, np.nan, 12, 5]) == "3-12, 1 never"
    assert comparison_words.each_seed([3, 4, 12, 5]) == "3-12"
    assert comparison_words.each_seed([np.nan] * 4) == "4 never"


def test_the_reference_is_a_label_or_a_method_and_scratch_may_be_absent():
    runs = {"scratch": SLOW, "runs/b": QUICKER}
    assert reference_of(runs, "scratch") == "scratch"
    assert reference_of(runs, "repaint") == reference_of(runs, "runs/b") == "runs/b"
    assert reference_of(runs, "runs/repaint/") == "runs/b"  # its folder
    assert reference_of({"runs/b": QUICKER}, "scratch") is None
    with pytest.raises(NotFound, match="unknown reference 'kickstart'"):
        reference_of(runs, "kickstart")


def test_a_record_is_strict_json():
    compared, _ = standings(SLOW, LOST)
    rows = [as_row(standing) for standing in compared.standings]
    printed = json.loads(json.dumps(rows, allow_nan=False))
    assert tuple(printed[0]) == COLUMNS
    assert (printed[0]["k"], printed[1]["k"], printed[1]["k_each"]) == (5, None, [None, None])


def printed(compared, monkeypatch, **options):
    """What is printed of a comparison on 80 columns."""
    screen = Console(file=io.StringIO(), width=80, highlight=False, soft_wrap=True, **options)
    monkeypatch.setattr(comparison_table, "out", screen)
    comparison_table.print_comparison(compared)
    return screen.file.getvalue()


def test_tables_fit_80_columns_and_say_who_never_arrives(monkeypatch):
    text = printed(standings(SLOW, QUICKER, LOST)[0], monkeypatch)
    assert max(map(len, text.splitlines())) <= 80
    for words in ("target 4, the best mean of scratch", "60%", "never", "0.1"):
        assert words in text
    given, _ = standings(SLOW, QUICKER, target=2.5)
    assert given.goal == "2.5"
    assert "repaint earned 1.62 above scratch per iteration" in " ".join(text.split())


@pytest.mark.parametrize("colours", [{}, {"force_terminal": True, "color_system": "standard"}])
def test_long_labels_are_shown_whole_and_runs_have_numbers(monkeypatch, colours):
    rng = np.random.default_rng(1)
    curves = [-1e4 + 5e3 * rng.random((10, 30)).cumsum(1), -1e4 + 4e3 * rng.random((10, 25))]
    teacher = "a-teacher-with-a-name-of-" + "x" * 39
    labels = ["scratch", f"repaint from {teacher} (learning_rate 0.0003, gamma 0.99)"]
    both = [run(label, *curve, steps=2048) for label, curve in zip(labels, curves, strict=True)]
    compared = comparison_of(dict(zip(labels, both, strict=True)), "scratch", None)
    text = re.sub(r"\x1b\[[0-9;]*m", "", printed(compared, monkeypatch, **colours))
    assert max(map(len, text.splitlines())) <= 80
    said = " ".join(text.split())
    assert f"run 2 repaint from {teacher} (learning_rate 0.0003, gamma 0.99)" in said
    assert "warning: run 2 has only 25 of 30 iterations: all runs are compared" in said
    assert "run 2 earned" in said
    assert said.count(teacher) == 1
    numbers = [line for line in text.splitlines() if line.startswith("run 2  10 ")]
    assert len(numbers) == 1


@pytest.mark.parametrize(
    ("seconds", "said"), [(42.4, "42 s"), (186, "3.1 min"), (9000, "2.5 h"), (0.2, "0.2 s")]
)
def test_durations_are_read_at_a_glance(seconds, said):
    assert comparison_table.duration(seconds) == said


@pytest.fixture
def two_runs(repaint, home):
    add_teacher(home / "home" / "zoo")
    repaint(*SCRATCH, "--run", "one")
    words = ["transfer", "--task", "reacher", "--teacher", "old-hand", *QUICK]
    repaint(*words, "--run", "two")
    return home


def test_compare_lays_runs_side_by_side(repaint, two_runs):
    said = repaint("compare", "one", "two")
    assert said.code == 0
    assert (two_runs / "compare.png").read_bytes().startswith(b"\x89PNG")
    assert "repaint from old-hand" in said.out
    assert said.out.endswith("\nnext: repaint compare one two --report report\n")
    printed = json.loads(repaint("compare", "one", "two", "--json").out)
    scratch, taught = printed["runs"]
    returns = column(two_runs / "one", "eval_return")
    assert printed["target"] == pytest.approx(max(returns), rel=1e-5)
    assert scratch["k"] == 1 + returns.index(max(returns))
    assert scratch["area"] == pytest.approx(sum(returns) / 2, rel=1e-5)
    expected = None if taught["k"] is None else 204 * taught["k"]
    assert taught["env_steps"] == expected


def column(folder, name):
    with (folder / "metrics.csv").open() as file:
        return [float(row[name]) for row in csv.DictReader(file)]


def test_a_report_stands_alone(repaint, two_runs):
    said = repaint("compare", "one", "two", "--report", "report")
    assert said.code == 0
    assert said.out.endswith("\nnext: repaint open report\n")
    folder = two_runs / "report"
    names = {"report.html", "comparison.csv", "curves.csv", "curves.png", "curves.svg"}
    assert {path.name for path in folder.iterdir()} == names
    assert not (two_runs / "compare.png").exists()
    with (folder / "comparison.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["run"] for row in rows] == ["scratch", "repaint from old-hand"]
    with (folder / "curves.csv").open() as file:
        means = [float(row["mean"]) for row in csv.DictReader(file) if row["run"] == "scratch"]
    assert means == pytest.approx(column(two_runs / "one", "eval_return"), rel=1e-5)
    before = (folder / "curves.svg").read_bytes()
    repaint("compare", "one", "two", "--report", "report")
    assert (folder / "curves.svg").read_bytes() == before


def test_a_target_and_a_reference_may_be_named(repaint, two_runs):
    words = ["compare", "one", "two", "--json", "--target", "-99", "--reference", "repaint"]
    printed = json.loads(repaint(*words).out)
    assert (printed["target"], printed["reference"]) == (-99, "repaint from old-hand")
    assert [row["k"] for row in printed["runs"]] == [1, 1]


def test_a_comparison_of_one_run_names_the_training_that_it_lacks(repaint, two_runs):
    said = repaint("compare", "two")
    scratch = "next: repaint transfer --task reacher --method scratch --set "
    assert said.out.splitlines()[-1].startswith(scratch)
    following = said.out.splitlines()[-1].removeprefix("next: repaint ")
    assert repaint(*shlex.split(following), "--run", "three").code == 0
    assert repaint("compare", "two", "three").out.startswith("reacher, target")
    assert repaint("compare", "one").out.endswith("\nnext: repaint open one\n")


def test_another_reference_and_target_are_kept_in_the_command_of_the_report(repaint, two_runs):
    said = repaint("compare", "one", "two", "--target", "-99", "--reference", "repaint")
    assert said.out.endswith(
        "\nnext: repaint compare one two --reference two --target=-99.0 --report report\n"
    )


def test_compare_does_without_a_scratch_run_and_passes_over_runs_that_never_began(
    repaint, two_runs
):
    header = (two_runs / "one" / "metrics.csv").read_text().splitlines()[0]
    (two_runs / "one" / "metrics.csv").write_text(header + "\n")
    said = repaint("compare", *(path.name for path in two_runs.iterdir() if path.is_dir()))
    assert said.code == 0
    assert "unknown without a run from scratch" in said.out
    printed = json.loads(repaint("compare", "one", "two", "--json").out)
    (only,) = printed["runs"]
    assert (only["run"], printed["target"], only["k"]) == ("repaint from old-hand", None, None)


def test_compare_refuses_runs_of_several_tasks(repaint, home):
    repaint(*SCRATCH, "--run", "one")
    repaint(*SCRATCH, "--task", "reacher-gentle", "--run", "two")
    said = repaint("compare", "one", "two")
    assert said.code == 3
    assert said.err == "error: expected runs of one task, found reacher, reacher-gentle\n"


def test_compare_refuses_runs_of_one_name_and_other_rewards(repaint, home):
    repaint(*SCRATCH, "--run", "one")
    repaint(*SCRATCH, "--set", "reward.reward_ctrl=2", "--run", "two")
    said = repaint("compare", "one", "two")
    assert said.code == 3
    assert said.err == (
        "error: expected runs of one task, found other [reward] settings in two than in one\n"
    )


def test_compare_tells_runs_of_one_name_and_other_lengths_apart(repaint, home):
    repaint(*SCRATCH, "--run", "a/scratch")
    repaint(*SCRATCH, "--run", "b/scratch", "--seed", 3, "--iterations", 4)
    said = repaint("compare", "a/scratch", "b/scratch")
    longer = "scratch (seed 3, n_iterations 4)"
    assert f"run 2 {longer}" in " ".join(said.out.split())
    assert "over 2 iterations" in " ".join(said.out.split())
    assert "warning: run 1 has only 2 of 4 iterations" in said.out
    printed = json.loads(repaint("compare", "a/scratch", "b/scratch", "--json").out)
    assert [row["run"] for row in printed["runs"]] == ["scratch (seed 0, n_iterations 2)", longer]
    first, second, *_ = column(home / "b" / "scratch", "eval_return")
    assert printed["runs"][1]["area"] == pytest.approx((first + second) / 2, rel=1e-4)


def test_several_methods_are_trained_on_the_same_seeds_and_compared(repaint, home):
    add_teacher(home / "home" / "zoo")
    words = ["--task", "reacher", "--teacher", "old-hand", "--methods", "scratch,kickstart"]
    rest = ["--iterations", 2, *QUICK[4:], "--set", "eval.episodes=2"]
    said = repaint("compare", *words, *rest, "--seeds", 2, "--jobs", 2, "--report", "report")
    assert said.code == 0, said.err
    (folder,) = (home / "runs" / "reacher").iterdir()
    assert {path.name for path in folder.iterdir()} == {"scratch", "kickstart"}
    for method in ("scratch", "kickstart"):
        record = json.loads((folder / method / "run.json").read_text())
        assert (record["state"], record["seeds"], record["method"]) == ("finished", [0, 1], method)
        assert (folder / method / "curves.png").is_file()
    assert "kickstart from old-hand" in (home / "report" / "report.html").read_text()
    assert "2 of 2: wrote runs/reacher/compare-" in said.err
    again = repaint("compare", *words, *rest, "--seeds", 1, "--json", "--output", "x.png")
    assert len(json.loads(again.out)["runs"]) == 2


def test_a_reference_that_never_arrives_is_no_measure():
    _, rows = standings(SLOW, QUICKER, target=4.5)
    assert np.isnan(rows["repaint"].reduced).all()
    better = run("repaint", [9, 9], [9, 9])
    _, rows = standings(SLOW, better, target=9)
    assert rows["repaint"].reached == 1
    assert np.isnan([*rows["repaint"].reduced, rows["repaint"].seconds_reduced]).all()
