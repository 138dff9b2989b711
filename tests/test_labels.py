"""Labels of runs say what differs, and no two are alike."""

from pathlib import Path

import pytest

from repaint_cli.runs.folder import RunFolder
from repaint_cli.runs.labels import labels_of
from repaint_cli.runs.reader import RecordedRun
from repaint_cli.runs.record import RunRecord
from repaint_cli.runs.record_parts import TeacherRecord
from repaint_cli.tasks.card_files import read_task


def run(folder="runs/reacher/one", *settings, method="scratch", teacher=None, seeds=(0,)):
    teachers = [TeacherRecord(name=teacher)] if teacher else []
    record = RunRecord(method=method, seeds=list(seeds), task={}, teachers=teachers)
    task = read_task("reacher").with_settings(list(settings))
    return RecordedRun(RunFolder(Path(folder)), record, task, {})


FAST, LATER = "ppo.learning_rate=0.001", "ppo.n_iterations=20"


@pytest.mark.parametrize(
    ("runs", "labels"),
    [
        ([run(), run(method="repaint", teacher="old")], ["scratch", "repaint from old"]),
        ([run(), run("b", FAST)],
         ["scratch (learning_rate 0.0003)", "scratch (learning_rate 0.001)"]),
        ([run(seeds=(0, 1, 2)), run("b", seeds=(3, 4, 5)), run("c", method="kickstart")],
         ["scratch (seeds 0-2)", "scratch (seeds 3-5)", "kickstart"]),
        ([run(seeds=(3,)), run("b", seeds=(0, 2)), run("c", seeds=(4, 5))],
         ["scratch (seed 3)", "scratch (seeds 0 2)", "scratch (seeds 4-5)"]),
        ([run(), run("b", FAST, LATER)],
         ["scratch (n_iterations 60, learning_rate 0.0003)",
          "scratch (n_iterations 20, learning_rate 0.001)"]),
        ([run(), run("b", "transfer.iterations=9")],
         ["scratch (iterations 4)", "scratch (iterations 9)"]),
        ([run(), run("b", "eval.episodes=9", "q_learning.threshold=1")],
         ["scratch (q_learning.threshold 0.0, episodes 20)",
          "scratch (q_learning.threshold 1.0, episodes 9)"]),
        ([run("runs/reacher/one"), run("runs/reacher/two")], ["scratch (one)", "scratch (two)"]),
        ([run("a/one"), run("b/one"), run("c", FAST)],
         ["scratch (learning_rate 0.0003, a/one)", "scratch (learning_rate 0.0003, b/one)",
          "scratch (learning_rate 0.001, c)"]),
        ([run("same"), run("same")], ["scratch (same #1)", "scratch (same #2)"]),
    ],
    ids=lambda x: "",
)  # fmt: skip
def test_what_differs_is_said(runs, labels):
    assert labels_of(runs) == labels


def test_of_many_settings_a_few_are_named_unless_more_are_needed():
    many = [FAST, LATER, "ppo.gamma=0.9", "ppo.gae_lambda=0.9", "ppo.n_epochs=3"]
    for label in labels_of([run(), run("b", *many)]):
        assert label.count(",") == 2
    runs = [run(str(n), *many[:n], *[f"ppo.ent_coef=0.{n % 2}"]) for n in range(6)]
    assert len(set(labels_of(runs))) == 6


def test_long_values_are_cut():
    first, second = labels_of([run(), run("b", f"net.hidden={[64] * 40}")])
    assert first == "scratch (hidden [64, 64])"
    assert len(second) < 50
