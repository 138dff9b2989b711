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
from repaint_cli.runs.comparison import comparison_of, reference_of
from repaint_cli.runs.comparison_rows import COLUMNS, TARGET_COLUMNS, as_row, target_rows

SCRATCH = ["transfer", "--task", "reacher", "--method", "scratch", *QUICK]


def run(method, *returns, steps=100.0, seconds=2.0, seed=0):
    """A run that earned these returns, (S, K), with seeds from `seed` on."""
    curves = np.array(returns, float)
    k = np.arange(1, curves.shape[1] + 1) * np.ones((len(curves), 1))
    rows = {"eval_return": curves, "env_steps": steps * k, "seconds": seconds * k}
    return SimpleNamespace(
        until=lambda n: run(method, *curves[:, :n], steps=steps, seconds=seconds, seed=seed),
        method=method, seeds=list(range(seed, seed + len(curves))), label=method,
        returns=curves, rows=rows,
        task=SimpleNamespace(name="reacher"), folder=Path("runs") / method,
    )  # fmt: skip


SLOW = run("scratch", [0, 1, 2, 3, 4], [0, 1, 2, 3, 4], [0, 1, 2, 3, 4])
QUICKER = run("repaint", [0, 4, 4, 4, 4], [2, 4, 4, 4, 4], [1, 4, 4, 4, 4], steps=200, seconds=1)
LOST = run("instance", [0, 0, 0, 0, 3], [0, 0, 0, 0, 3])


def standings(*runs, targets=()):
    compared = comparison_of({r.method: r for r in runs}, "scratch", targets)
    return compared, {standing.label: standing for standing in compared.standings}


def test_the_target_is_the_references_best_mean_unless_one_is_given():
    assert standings(SLOW, QUICKER)[0].target == 4
    assert standings(SLOW, QUICKER, targets=[2.5])[0].target == 2.5
    assert comparison_of({"repaint": QUICKER}, None).target is None


def test_to_the_target_by_hand():
    _, rows = standings(SLOW, QUICKER, LOST)
    scratch, repaint, lost = (rows[name] for name in ("scratch", "repaint", "instance"))
    assert (scratch.reached, repaint.reached) == (5, 2)
    assert repaint.reduced == pytest.approx(0.6)
    assert (repaint.env_steps, repaint.seconds) == (400, 2)
    assert repaint.seconds_reduced == pytest.approx(1 - 2 / 10)
    assert np.isnan([lost.reached, lost.reduced, lost.env_steps, lost.seconds]).all()
    assert np.isnan(lost.reached_each).all()
    assert np.isnan([scratch.reduced, scratch.seconds_reduced]).all()
    assert scratch.against is None


def test_scores_by_hand():
    _, rows = standings(SLOW, QUICKER)
    repaint = rows["repaint"]
    assert repaint.first[0] == 1
    assert repaint.area[0] == pytest.approx((0.5 * 1 + 4 + 4 + 4 + 0.5 * 4) / 4)
    assert (repaint.best, repaint.final) == (4, (4, 4, 4))
    assert repaint.against.area.pairs == 3
    assert repaint.against.area.mean[0] == pytest.approx(repaint.area[0] - 2)
    assert repaint.against.area.p == pytest.approx(2 / 8)
    assert repaint.against.better[0] == 1


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
    ("number", "said"),
    [
        (0.6, "60%"), (-11.13, "×12.1"), (-0.5, "×1.5"), (0.0, "0%"), (np.nan, "-"),
    ],
)  # fmt: skip
def test_who_is_later_is_no_percentage(number, said):
    assert comparison_words.reduction(number) == said


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
    for words in ("first at 4, the best mean of scratch", "60%", "never", "0.25", "1 [0.337,1]"):
        assert words in text
    given, _ = standings(SLOW, QUICKER, targets=[2.5])
    assert given.goal == "2.5"
    assert "repaint is probably ahead of scratch: its mean return is 1.62 higher" in text


def test_six_long_runs_with_large_numbers_fit_80_columns(monkeypatch):
    rng = np.random.default_rng(1)
    runs = [
        run(f"repaint-joint from teacher-{i}", *(-1e5 + 2e4 * rng.random((12, 40)).cumsum(1)))
        for i in range(6)
    ]
    labels = {one.label: one for one in runs}
    compared = comparison_of(labels, runs[0].label)
    text = printed(compared, monkeypatch)
    assert max(map(len, text.splitlines())) <= 80
    for n in range(1, 7):
        assert 4 <= sum(line.startswith(f"run {n}  ") for line in text.splitlines()) <= 5


def test_seeds_that_do_not_arrive_are_counted_and_not_late():
    part = run("repaint", [0, 4, 4, 4, 4], [0, 0, 0, 0, 0], [0, 0, 4, 4, 4])
    _, rows = standings(SLOW, part, targets=[4, 2])
    low, high = rows["repaint"].targets
    assert (low.target, high.target, high.share) == (2, 4, None)
    assert high.arrived == 2
    assert high.k[0] == pytest.approx((2 + 5 + 3) / 3)  # the one that does not counts as 5, not 6
    assert high.earlier.mean[0] == pytest.approx(5 - (2 + 5 + 3) / 3)
    assert comparison_words.seeds_k(high) == "3.33 2/3"
    assert rows["scratch"].targets[0].earlier is None
    row = target_rows(rows["repaint"])[1]
    assert tuple(row) == TARGET_COLUMNS
    assert row["k_each"] == [2, None, 3]


def test_targets_are_shares_of_what_the_reference_converged_to():
    _, rows = standings(SLOW, QUICKER)
    assert [one.share for one in rows["repaint"].targets] == [0.25, 0.5, 0.75, 0.9, 1]
    assert [one.target for one in rows["repaint"].targets] == pytest.approx([1, 2, 3, 3.6, 4])
    assert [one.k[0] for one in rows["scratch"].targets] == [2, 3, 4, 5, 5]
    falling = run("scratch", [3, 2, 1], [3, 2, 1])
    assert standings(falling, run("repaint", [1, 2, 3]))[1]["repaint"].targets == ()


def test_a_target_that_nobody_reaches_is_said(monkeypatch):
    compared, rows = standings(SLOW, QUICKER, targets=[2, 50])
    text = printed(compared, monkeypatch)
    assert "no seed of any run reached 50 within 5 iterations\n" in text
    assert np.isnan(rows["repaint"].targets[1].p)
    assert comparison_words.unreached(compared) == [
        "no seed of any run reached 50 within 5 iterations"
    ]


def test_runs_with_other_seeds_are_compared_without_pairs(monkeypatch):
    other = run("repaint", [0, 4, 4, 4, 4], [2, 4, 4, 4, 4], [1, 4, 4, 4, 4], seed=2)
    compared, rows = standings(SLOW, other)
    assert rows["repaint"].against.area.pairs == 0
    assert rows["repaint"].against.area.p == pytest.approx(2 / 20)
    (said,) = comparison_words.seeds_can_show(compared)
    assert said.startswith("seeds of repaint and scratch that are not the same, in no pairs: ")
    some = run("repaint", *QUICKER.returns, [0, 1, 2, 3, 4], seed=1)
    compared, rows = standings(SLOW, some)
    assert rows["repaint"].against.area.pairs == 2
    (said,) = comparison_words.seeds_can_show(compared)
    assert said.startswith("2 seeds that repaint and scratch share, of 4: p cannot be below 0.5")


def test_what_three_and_ten_seeds_can_show():
    (said,) = comparison_words.seeds_can_show(standings(SLOW, QUICKER)[0])
    assert said.startswith("3 seeds: p cannot be below 0.25, so it decides nothing alone; ")
    ten = [run(name, *np.random.default_rng(1).random((10, 4))) for name in ("scratch", "repaint")]
    (said,) = comparison_words.seeds_can_show(standings(*ten)[0])
    assert said.startswith("10 seeds: p cannot be below 0.002; 95 % intervals ")
    one = [run(name, [0, 1, 2]) for name in ("scratch", "repaint")]
    compared, _ = standings(*one)
    assert comparison_words.seeds_can_show(compared) == []


@pytest.mark.parametrize(
    ("returns", "said"),
    [
        ([[0, 1], [0, 1], [0, 1]], "repaint earned exactly what scratch did"),
        ([[9, 9.1], [9, 9.2], [9, 9.1]], "repaint is probably ahead of scratch: "),
        ([[-9, -9.1], [-9, -9.2], [-9, -9.1]], "repaint is probably behind scratch: "),
        ([[0, 1], [0, 1.5], [0, 0.7]],
         "repaint cannot be told apart from scratch; about 291 seeds would show such a difference"),
    ],
)  # fmt: skip
def test_who_is_ahead_in_a_sentence(returns, said):
    scratch = run("scratch", [0, 1], [0, 1], [0, 1])
    (sentence,) = comparison_words.verdicts(standings(scratch, run("repaint", *returns))[0])
    assert sentence.startswith(said)


def test_one_seed_is_ahead_without_being_sure():
    both = run("scratch", [0, 1]), run("repaint", [2, 3])
    assert comparison_words.verdicts(standings(*both)[0]) == [
        "repaint earned 2 more than scratch; one seed shows no spread"
    ]


def test_many_seeds_that_agree_are_ahead():
    rng = np.random.default_rng(2)
    both = run("scratch", *rng.random((10, 4))), run("repaint", *(1 + rng.random((10, 4))))
    (sentence,) = comparison_words.verdicts(standings(*both)[0])
    assert sentence.startswith("repaint is ahead of scratch: its mean return is ")


def test_a_seed_that_ran_away_is_named_with_its_area(monkeypatch):
    curves = [[0, k, 2 + k / 10] for k in range(5)]
    lost = run("scratch", *curves, [0, -90, -90], seed=100)
    compared, rows = standings(lost, run("repaint", *curves, [0, 2, 2], seed=100))
    assert rows["repaint"].runaways == ()
    ((seed, area, middle),) = rows["scratch"].runaways
    assert (seed, area) == (105, pytest.approx(-67.5))
    assert -1 < middle < 4
    said = " ".join(printed(compared, monkeypatch).split())
    assert "seed 105 of scratch ran away from the others: its area is -67.5, the median's" in said
    assert as_row(rows["scratch"])["runaways"] == [105]


def test_area_over_steps_is_over_those_that_all_seeds_have():
    longer = run("repaint", [0, 4, 4, 4, 4], [2, 4, 4, 4, 4], [1, 4, 4, 4, 4], steps=200)
    compared, rows = standings(SLOW, longer)
    assert compared.steps == (200, 500)
    assert rows["scratch"].area_by_steps[0] == pytest.approx(2.5)  # from 1 to 4 in a straight line
    # from 1 on average at 200 to 4 at 400, then 4
    assert rows["repaint"].area_by_steps[0] == pytest.approx((200 * 2.5 + 100 * 4) / 300)
    assert compared.as_json()["steps"] == [200, 500]


def test_the_papers_measure_of_the_reference_against_itself():
    noisy = np.random.default_rng(3).normal(0, 1, (8, 12)) + np.linspace(0, 5, 12)
    compared, _ = standings(run("scratch", *noisy), run("repaint", *noisy))
    alike = compared.no_difference
    assert (alike.seeds, 0.2 < alike.never < 0.8) == (8, True)
    said = comparison_words.paper_alike(compared)
    assert said.startswith("two runs like scratch, with 8 seeds each, give “never” in ")
    assert said.endswith(" earlier")
    assert standings(run("scratch", [0, 1], [0, 2]))[0].no_difference is None


@pytest.mark.parametrize("colours", [{}, {"force_terminal": True, "color_system": "standard"}])
def test_long_labels_are_shown_whole_and_runs_have_numbers(monkeypatch, colours):
    rng = np.random.default_rng(1)
    curves = [-1e4 + 5e3 * rng.random((10, 30)).cumsum(1), -1e4 + 4e3 * rng.random((10, 25))]
    teacher = "a-teacher-with-a-name-of-" + "x" * 39
    labels = ["scratch", f"repaint from {teacher} (learning_rate 0.0003, gamma 0.99)"]
    both = [run(label, *curve, steps=2048) for label, curve in zip(labels, curves, strict=True)]
    compared = comparison_of(dict(zip(labels, both, strict=True)), "scratch")
    text = re.sub(r"\x1b\[[0-9;]*m", "", printed(compared, monkeypatch, **colours))
    assert max(map(len, text.splitlines())) <= 80
    said = " ".join(text.split())
    assert f"run 2 repaint from {teacher} (learning_rate 0.0003, gamma 0.99)" in said
    assert "warning: run 2 has only 25 of 30 iterations: all runs are compared" in said
    assert "run 2 is behind run 1: its mean return is " in said
    assert said.count(teacher) == 1
    numbers = [line for line in text.splitlines() if line.startswith("run 2  10 ")]
    assert len(numbers) == 1


@pytest.mark.parametrize(
    ("seconds", "said"), [(42.4, "42 s"), (186, "3.1 min"), (9000, "2.5 h"), (0.2, "0.2 s")]
)
def test_durations_are_read_at_a_glance(seconds, said):
    assert comparison_table.duration(seconds) == said


@pytest.fixture
def two_runs(repaint, lay, home):
    add_teacher(home / "home" / "zoo")
    lay(*SCRATCH, "--run", "one")
    words = [
        "transfer",
        "--task",
        "reacher",
        "--teacher",
        "old-hand",
        "--method",
        "repaint",
        *QUICK,
    ]
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
    names = {"report.html", "comparison.csv", "curves.csv", "targets.csv"}
    names |= {f"{n}.{kind}" for n in ("curves", "targets", "profiles") for kind in ("png", "svg")}
    assert {path.name for path in folder.iterdir()} == names
    assert not (two_runs / "compare.png").exists()
    with (folder / "comparison.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["run"] for row in rows] == ["scratch", "repaint from old-hand"]
    with (folder / "curves.csv").open() as file:
        means = [float(row["mean"]) for row in csv.DictReader(file) if row["run"] == "scratch"]
    assert means == pytest.approx(column(two_runs / "one", "eval_return"), rel=1e-5)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    repaint("compare", "one", "two", "--report", "report")
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


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
    assert repaint("compare", "two", "three").out.startswith("reacher, compared with scratch\n")
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
    assert "without a run from scratch to compare with; name one with --reference" in said.out
    printed = json.loads(repaint("compare", "one", "two", "--json").out)
    (only,) = printed["runs"]
    assert (only["run"], printed["target"], only["k"]) == ("repaint from old-hand", None, None)


def test_compare_refuses_runs_of_several_tasks(repaint, lay, home):
    lay(*SCRATCH, "--run", "one")
    lay(*SCRATCH, "--task", "reacher-gentle", "--run", "two")
    said = repaint("compare", "one", "two")
    assert said.code == 3
    assert said.err == "error: expected runs of one task, found reacher, reacher-gentle\n"


def test_compare_refuses_runs_of_one_name_and_other_rewards(repaint, lay, home):
    lay(*SCRATCH, "--run", "one")
    lay(*SCRATCH, "--set", "reward.reward_ctrl=2", "--run", "two")
    said = repaint("compare", "one", "two")
    assert said.code == 3
    assert said.err == (
        "error: expected runs of one task, found other [reward] settings in two than in one\n"
    )


def test_compare_tells_runs_of_one_name_and_other_lengths_apart(repaint, lay, home):
    lay(*SCRATCH, "--run", "a/scratch")
    lay(*SCRATCH, "--run", "b/scratch", "--seed", 3, "--iterations", 4)
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
    assert {path.name for path in folder.iterdir()} == {"scratch", "kickstart", "compare.json"}
    for method in ("scratch", "kickstart"):
        record = json.loads((folder / method / "run.json").read_text())
        assert (record["state"], record["seeds"], record["method"]) == ("finished", [0, 1], method)
        assert (folder / method / "curves.png").is_file()
    assert "kickstart from old-hand" in (home / "report" / "report.html").read_text()
    assert "2 of 2: wrote runs/reacher/compare-" in said.err
    again = repaint("compare", *words, *rest, "--seeds", 1, "--json", "--output", "x.png")
    assert len(json.loads(again.out)["runs"]) == 2


def test_a_reference_that_never_arrives_is_no_measure():
    _, rows = standings(SLOW, QUICKER, targets=[4.5])
    assert np.isnan(rows["repaint"].reduced)
    better = run("repaint", [9, 9], [9, 9])
    _, rows = standings(SLOW, better, targets=[9])
    assert rows["repaint"].reached == 1
    assert np.isnan([rows["repaint"].reduced, rows["repaint"].seconds_reduced]).all()
