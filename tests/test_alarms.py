import json
import os
import re
from types import SimpleNamespace

import numpy as np
import pytest
from small_runs import QUICK, add_teacher

from repaint_cli.learn.stats import IterationStats
from repaint_cli.runs.alarms import alarms_of, reference_of
from repaint_cli.runs.metrics import Report
from repaint_cli.tasks.card_files import read_task

pytestmark = pytest.mark.usefixtures("unpainted")  # no picture of a run is looked at

SCRATCH = ["transfer", "--task", "reacher", "--method", "scratch", *QUICK]
QUIET = {"kept_fraction": [0.5], "kept_reward": [2], "student_reward": [1]}


def report(k=4, returns=((0.0, 0.0),), lengths=((9.0, 9.0),), **numbers):
    given = {name: np.array(values, float) for name, values in numbers.items()}
    played = SimpleNamespace(returns=np.array(returns, float), lengths=np.array(lengths, float))
    return Report(IterationStats(k, "instance", given), played, 0.0)


def said(*args, before=(), lengths=(), reference=None, **numbers):
    found = alarms_of(report(*args, **numbers), before, lengths, reference)
    return [(alarm.kind, alarm.text) for alarm in found]


@pytest.mark.parametrize(
    ("share", "kept", "own", "kind", "warning"),
    [
        ([0.5], [0.1], [0.2], "kept-paid-less", "samples were paid less .* \\(0.1 < 0.2\\)"),
        ([0.5], [0.2], [0.1], None, None),
        ([0.5, 0.5], [1, 10], [2, 3], "kept-paid-less", "of 1 of 2 seeds were paid .* \\(1 < 2\\)"),
        ([0, 0.5], [np.nan, 2], [1, 1], None, None),
        ([0, 0], [np.nan, np.nan], [1, 1], "nothing-kept", "no teacher sample was kept"),
    ],
)
def test_what_was_kept(share, kept, own, kind, warning):
    found = said(kept_fraction=share, kept_reward=kept, student_reward=own)
    assert [k for k, _ in found] == ([kind] if kind else [])
    if kind:
        assert re.match(f"iteration 4: .*{warning}", found[0][1])


@pytest.mark.parametrize(("log_ratio", "alarm"), [(-4.1, True), (-3.9, False), (np.nan, False)])
def test_actions_the_student_would_hardly_take(log_ratio, alarm):
    found = said(**QUIET, log_ratio=[log_ratio])
    assert [kind for kind, _ in found] == ["rare-actions"] * alarm
    if alarm:
        assert "0.02 times as likely" in found[0][1]


@pytest.mark.parametrize(
    ("theirs", "own", "alarm"), [(1, 2, True), (2, 1, False), (2, np.nan, False)]
)
def test_a_teacher_that_earns_less_than_the_student(theirs, own, alarm):
    found = said(**QUIET, teacher_return=[theirs], student_return=[own])
    assert [kind for kind, _ in found] == ["teacher-behind"] * alarm


@pytest.mark.parametrize(
    ("now", "promised", "alarm"), [(5.0, 1.0, True), (9.0, 1.0, False), (5.0, -1.0, False)]
)
def test_a_promise_of_the_critic_that_did_not_come_true(now, promised, alarm):
    before = [np.array([(9.0, 11.0)])]  # 10 ± ½·√2, and now the same: more than 2 is no chance
    found = said(4, [(now - 1, now + 1)], before=before, **QUIET, kept_advantage=[promised])
    assert [kind for kind, _ in found] == ["worse-than-promised"] * alarm
    assert not said(1, [(0.0, 0.0)], **QUIET, kept_advantage=[promised])


@pytest.mark.parametrize(
    ("lengths", "returns", "alarm"),
    [
        ((119, 88, 71), (-40, -35, -32), True),  # -0.34, -0.40, -0.45 a step
        ((119, 88, 71), (-119, -88, -71), True),  # -1 a step
        ((119, 88, 71), (-40, -20, -30), True),  # -0.34, -0.23, -0.42 a step
        ((119, 88, 71), (-40, -28, -20), False),  # a step costs less
        ((119, 88, 71), (40, 28, 20), False),  # a step earns
        ((119, 117, 115), (-40, -41, -42), False),  # by chance
        ((88, 119, 71), (-30, -45, -32), False),  # longer between
    ],
)
def test_episodes_that_end_ever_sooner_since_steps_cost(lengths, returns, alarm):
    before = [np.array([(own, own)], float) for own in returns[:2]]
    played = report(4, [(returns[2], returns[2])], [(lengths[2], lengths[2])])
    found = alarms_of(played, before, [np.array([own], float) for own in lengths[:2]], None)
    assert [one.kind for one in found] == ["ever-shorter"] * alarm
    if alarm:
        assert "episodes shorten (119 to 71 steps) and a step costs no less (-" in found[0].text


def test_three_iterations_in_a_row_under_scratch():
    reference = np.array([[5.0, 5, 5, 5], [7.0, 7, 7, 7]])  # 6 ± 1
    reports = [report(k, [(own, own)]) for k, own in enumerate((4.0, 5.5, 4.0, 4.0, 4.0), 1)]

    def kinds(k):
        before = [earlier.evaluation.returns for earlier in reports[: k - 1]]
        found = alarms_of(reports[k - 1], before, (), reference)
        return [alarm.kind for alarm in found]

    assert [kinds(k) for k in (1, 2, 3, 4)] == [[], [], [], []]
    reports[1] = report(2, [(4.0, 4.0)])
    assert kinds(2) == []
    assert kinds(4) == ["below-scratch"]
    assert kinds(5) == []  # where the reference has ended


def test_the_newest_run_from_scratch_beside_a_run_is_its_reference(repaint, lay, home):
    folder, card = (
        home / "runs" / "new",
        read_task("reacher").with_settings(["ppo.n_steps=204", "ppo.n_envs=4", "eval.episodes=2"]),
    )
    assert reference_of(folder, card, "ppo") is None
    lay(*SCRATCH, "--run", "runs/one")
    lay(*SCRATCH, "--run", "runs/other", "--set", "reward.reward_ctrl=2")
    (home / "runs" / "damaged").mkdir()
    (home / "runs" / "damaged" / "run.json").write_text("{")
    lay(*SCRATCH, "--run", "runs/newest", "--seeds", 2)
    os.utime(home / "runs" / "one" / "run.json", (1, 1))
    assert reference_of(folder, card, "ppo").shape == (2, 2)
    assert reference_of(folder, card, "q-learning") is None
    assert reference_of(folder, read_task("reacher"), "ppo") is None
    for name in ("one", "newest"):  # as schema 1 had it
        path = home / "runs" / name / "run.json"
        record = json.loads(path.read_text())
        del record["algorithm"]
        path.write_text(json.dumps(record))
    assert reference_of(folder, card, "ppo") is None


def test_alarms_are_in_the_log_and_in_the_record(repaint, home):
    add_teacher(home / "home" / "zoo")
    words = ["transfer", "--task", "reacher", "--teacher", "old-hand", *QUICK, "--run", "run"]
    run = repaint(*words, "--threshold", 1e9)
    assert "warning: iteration 2: no teacher sample was kept" in run.out
    (alarm, *_) = json.loads((home / "run" / "run.json").read_text())["alarms"]
    assert (alarm["iteration"], alarm["kind"]) == (2, "nothing-kept")


def test_a_schedule_that_ends_before_the_run_is_said(repaint, home):
    words = ["transfer", "--method", "scratch", "--task", "reacher", "--run", "run", *QUICK]
    decays = ["--set", "ppo.learning_rate_decay=2", "--set", "ppo.clip_decay=3"]
    said = repaint(*words, *decays)
    assert "warning" not in said.out
    said = repaint("transfer", "--resume", "run", "--iterations", 3)
    rate = "warning: ppo.learning_rate is 0 from iteration 3 of {} on, where nothing is learned"
    assert rate.format(3) + " (ppo.learning_rate_decay is 2); the run keeps it" in said.out
    assert said.out.count("warning") == 1
    said = repaint(*words, *decays, "--run", "next", "--iterations", 4)
    assert rate.format(4) + " (ppo.learning_rate_decay is 2); try --set" in said.out
    assert "ppo.clip_range is 0 from iteration 4 of 4 on, where policies hardly learn" in said.out
