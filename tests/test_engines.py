"""Engines: what fails is named and the others go on, what was lost goes on, nothing twice."""

import json
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import killed_runs
import pytest
from failing_env import card
from small_runs import QUICK, add_teacher, files_below
from test_resume import assert_same
from test_runs import record_of, rows_of

from repaint_cli.engines import local
from repaint_cli.engines.engine import RunsFailed, carry_on, is_finished
from repaint_cli.engines.options import EngineOptions, RunsWatcher
from repaint_cli.engines.root import driven
from repaint_cli.errors import CardError, CheckpointError, NotFound, UsageError
from repaint_cli.files.lease import Lease
from repaint_cli.files.lock import Locked
from repaint_cli.runs.kept_plans import keep_plans, kept_plans
from repaint_cli.runs.owner import new_run
from repaint_cli.runs.plan import Plan
from repaint_cli.tasks.card_files import read_task

pytestmark = pytest.mark.usefixtures("unpainted")  # no picture of a run is looked at


class Notes(RunsWatcher):
    def __init__(self):
        self.notices = []

    def notice(self, text):
        self.notices.append(text)


def outcomes(plans, **options):
    watcher = Notes()
    with EngineOptions(**options).open(watcher) as engine:
        return sorted(engine.run(plans), key=lambda one: one.folder), watcher.notices


def test_a_run_is_begun_goes_on_and_is_left_alone(tmp_path):
    plan = killed_runs.plan("repaint", tmp_path / "run")
    assert not is_finished(plan)
    with new_run(plan) as experiment:
        reports = experiment.run()
        next(reports)
        next(reports)
        reports.close()
    assert record_of(plan.folder)["state"] == "interrupted"
    carry_on(plan, "mine")
    assert (len(rows_of(plan.folder)), record_of(plan.folder)["attempt"]) == (24, 2)
    assert is_finished(plan)
    before = files_below(plan.folder)
    carry_on(plan, "mine")
    assert files_below(plan.folder) == before
    plan.files.policy(3).unlink()  # killed before all was written
    assert not is_finished(plan)
    calm = killed_runs.plan("repaint", tmp_path / "calm" / "run")
    carry_on(calm, "mine")
    carry_on(plan, "mine")
    assert_same(plan.folder, calm.folder)


def test_who_fails_is_not_tried_again_and_the_others_go_on(tmp_path, monkeypatch):
    plans = [killed_runs.plan("repaint", tmp_path / name) for name in "abc"]
    tried = []

    def fails(plan, driver):
        tried.append(plan.folder.name)
        if plan.folder.name == "a":
            raise CardError("the arm fell off")
        if plan.folder.name == "b":
            raise ZeroDivisionError("odd")

    monkeypatch.setattr(local, "carry_on", fails)
    done, notices = outcomes(plans)
    assert (tried, notices) == (["a", "b", "c"], [])
    assert [type(one.error) for one in done] == [CardError, ZeroDivisionError, type(None)]
    said = str(RunsFailed.of(done[:2], 3, "repaint again"))
    assert said.startswith(f"2 of 3 runs failed: {tmp_path}/a: the arm fell off; {tmp_path}/b: ")
    assert "ZeroDivisionError: odd" in said
    assert said.endswith("; finished runs are kept; go on with: repaint again")


@pytest.mark.parametrize("retries", [pytest.param(0, marks=pytest.mark.slow), 1])
def test_a_process_that_is_killed_is_tried_again_as_often_as_told(home, retries):
    (home / "bad.toml").write_text(card("dies once"))
    (home / "good.toml").write_text(card())
    plans = [
        Plan(read_task(str(home / f"{name}.toml")), "scratch", [0], home / name)
        for name in ("bad", "good")
    ]
    (home / "doomed").touch()
    (bad, good), notices = outcomes(plans, jobs=2, retries=retries)
    assert (good.error, good.tries) == (None, 1)
    if retries:
        assert (bad.error, bad.tries) == (None, 2)
        assert record_of(home / "bad")["attempt"] == 2
        (notice,) = notices
        assert "was killed (signal 9)" in notice
        assert notice.endswith("it goes on in another one")
    else:
        assert "was killed (signal 9)" in bad.reason
        assert not notices


def test_an_own_error_in_a_process_is_not_tried_again(home):
    (home / "bad.toml").write_text(card("fails"))
    (home / "good.toml").write_text(card())
    plans = [
        Plan(read_task(str(home / f"{name}.toml")), "scratch", [0], home / name)
        for name in ("bad", "good")
    ]
    (bad, good), notices = outcomes(plans, jobs=2, retries=2)
    assert (good.error, good.tries) == (None, 1)
    assert isinstance(bad.error, CardError)
    assert (bad.tries, notices) == (1, [])


def test_a_comparison_says_what_failed_and_goes_on_from_its_folder(repaint, home, monkeypatch):
    add_teacher(home / "home" / "zoo")
    real = local.carry_on

    def fails(plan, driver):
        if plan.method == "scratch":
            raise CardError("the arm fell off")
        real(plan, driver)

    words = ["--task", "reacher", "--teacher", "old-hand", "--methods", "scratch,kickstart", *QUICK]
    with monkeypatch.context() as patch:
        patch.setattr(local, "carry_on", fails)
        said = repaint("compare", *words[:6], *QUICK[:2], *QUICK[4:], "--seeds", 2, "--retries", 2)
    (root,) = home.glob("runs/reacher/compare-*")
    place = root.relative_to(home)
    assert said.code == 1
    *_, failed, wrote, error = said.err.splitlines()
    assert failed == f"failed: {place}/scratch: the arm fell off"
    assert wrote == f"2 of 2: wrote {place}/kickstart/"
    again = f"repaint compare --resume {place} --retries 2"
    assert error == (
        f"error: 1 of 2 runs failed: {place}/scratch: the arm fell off; finished runs are kept; "
        f"go on with: {again}"
    )
    kept = files_below(root / "kickstart")
    rows = json.loads(repaint("status", root, "--json").out)
    assert [(row["state"], row["iteration"], row["iterations"]) for row in rows] == [
        ("waiting", 0, 2), ("finished", 2, 2)
    ]  # fmt: skip
    said = repaint(*again.split()[1:], "--json", "--output", "x.png")
    assert said.code == 0, said.err
    assert [row["run"] for row in json.loads(said.out)["runs"]] == [
        "scratch", "kickstart from old-hand"
    ]  # fmt: skip
    assert files_below(root / "kickstart") == kept
    assert record_of(root / "scratch")["seeds"] == [0, 1]
    assert sorted(path.name for path in root.iterdir()) == ["compare.json", "kickstart", "scratch"]


def test_plans_that_are_kept_are_read_as_they_were(home):
    add_teacher(home / "home" / "zoo")
    plans = [killed_runs.plan("repaint", home / name) for name in ("a", "b")]
    keep_plans(plans, home)
    again = kept_plans(home)
    for before, after in zip(plans, again, strict=True):
        assert after == replace(before, folder=after.folder, acting=after.acting)
        assert after.folder == before.folder
        assert set(after.acting) == set(after.teachers)
    for text in ("{}", '{"runs": {}}', '{"runs": {"../a": {}}}', '{"runs": {"a": {}}}', "["):
        (home / "compare.json").write_text(text)
        with pytest.raises(CheckpointError, match=r"compare\.json"):
            kept_plans(home)
    with pytest.raises(NotFound, match="expected the folder of repaint compare --task"):
        kept_plans(home / "nowhere")


def test_code_that_a_list_of_plans_brings_along_does_not_run(home, monkeypatch):
    (home / "bad.toml").write_text(card())
    plan = Plan(read_task(str(home / "bad.toml")), "scratch", [0], home / "scratch")
    keep_plans([plan], home)
    assert kept_plans(home)  # by whoever began it
    monkeypatch.setenv("REPAINT_HOME", str(home / "somebody else"))
    with pytest.raises(CardError, match=r"compare\.json would run .* nothing was begun here"):
        kept_plans(home)


def test_of_two_commands_on_one_folder_the_second_is_refused(repaint, home):
    (home / "root").mkdir()
    keep_plans([killed_runs.plan("repaint", home / "root" / "repaint")], home / "root")
    before = {name for name in files_below(home / "root")}
    with driven(home / "root", "first"):
        said = repaint("compare", "--resume", "root")
        assert (said.code, said.err.count("\n")) == (Locked.exit_code, 1)
        assert "root is being written by another process; wait for it" in said.err
    assert {name for name in files_below(home / "root")} == before


def test_the_same_command_goes_on_in_the_folder_that_it_names(repaint, home):
    add_teacher(home / "home" / "zoo")
    words = ["compare", "--task", "reacher", "--teacher", "old-hand", "--into", "mine", *QUICK[4:]]
    words += ["--set", "eval.episodes=2", "--iterations", 2, "--seeds", 1, "--output", "x.png"]
    words += ["--replace", "--methods"]
    assert repaint(*words, "scratch,kickstart").code == 0
    (home / "mine" / "kickstart" / "seed-0.safetensors").unlink()
    kept = files_below(home / "mine" / "scratch")
    said = repaint(*words, "scratch,kickstart")
    assert said.code == 0, said.err
    assert files_below(home / "mine" / "scratch") == kept
    assert (home / "mine" / "kickstart" / "seed-0.safetensors").is_file()
    said = repaint(*words, "kickstart")
    assert (said.code, said.err.splitlines()[-1]) == (
        7, "error: mine holds another comparison: scratch, kickstart against kickstart; name "
        "another folder with --into, or go on with that one: repaint compare --resume mine"
    )  # fmt: skip
    said = repaint(*words, "scratch,kickstart", "--set", "ppo.gamma=0.5")
    assert "mine holds another comparison: kickstart.task.ppo.gamma 0.99 against 0.5" in said.err
    words[words.index("mine")] = "home"
    said = repaint(*words, "scratch,kickstart")
    assert "error: home is there and holds no comparison; name another with --into" in said.err
    assert files_below(home / "mine" / "scratch") == kept


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs SIGKILL")
def test_a_folder_whose_command_was_killed_is_free(home):
    code = (
        "import os; from pathlib import Path; from repaint_cli.engines.root import driven\n"
        f"with driven(Path({str(home)!r}), 'x'): os.kill(os.getpid(), 9)"
    )
    child = subprocess.run([sys.executable, "-c", code], check=False)
    assert child.returncode == -signal.SIGKILL
    assert Lease.read(home).driver == "x"
    with driven(home, "second"):
        assert Lease.read(home).driver == "second"
    assert not list(Path(home).glob("run.lock"))


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"engine": "slurm"}, "expected --engine local, ray or ray:ADDRESS, found slurm"),
        ({"engine": "local:x"}, "expected --engine local, ray or ray:ADDRESS, found local:x"),
        ({"jobs": 0}, "expected at least 1 job, found 0"),
        ({"cpus_per_run": 0}, "expected --cpus-per-run of at least 1, found 0"),
        ({"retries": -1}, "expected --retries of at least 0, found -1"),
        ({"gpus_per_run": 0.5}, "--gpus-per-run is for --engine ray; leave it out"),
        ({"engine": "ray", "gpus_per_run": -1.0}, "expected --gpus-per-run of at least 0"),
    ],
)
def test_options_that_may_not_be(options, text):
    with pytest.raises(UsageError, match=text):
        EngineOptions(**options).check()


def test_options_are_typed_as_they_are():
    assert EngineOptions().words == ""
    options = EngineOptions("ray:a b", 2, cpus_per_run=3, retries=0)
    assert options.words == " --engine 'ray:a b' --jobs 2 --cpus-per-run 3 --retries 0"


def test_runs_have_the_threads_that_are_asked_for(tmp_path, monkeypatch):
    asked = []

    class Workers(local._Workers):
        def __init__(self, threads):
            asked.append(threads)
            super().__init__(threads)

        def ask(self, *_):
            return None

    monkeypatch.setattr(local, "_Workers", Workers)
    monkeypatch.setattr(local, "cores", lambda: 8)
    plan = killed_runs.plan("repaint", tmp_path / "run")
    outcomes([plan], jobs=2)
    outcomes([plan], jobs=2, cpus_per_run=3)
    outcomes([plan], cpus_per_run=1)
    assert asked == [4, 3, 1]
