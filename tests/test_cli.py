"""The commands, typed: what they print, write and leave alone. Errors are in test_errors."""

import io
import json
from math import log
from pathlib import Path

import numpy as np
import pytest
import torch
import typer
from rich.console import Console
from small_runs import QUICK, QUICK_LAP, add_teacher, files_below, weights_of

from repaint_cli import __version__
from repaint_cli.cli import screen
from repaint_cli.cli.app import app
from repaint_cli.cli.compare_options import CompareOptions
from repaint_cli.cli.evaluate import EvaluateOptions
from repaint_cli.cli.option_values import parse_ratio, seed_list
from repaint_cli.cli.train_teacher import TrainTeacherOptions
from repaint_cli.cli.transfer_options import TransferOptions
from repaint_cli.envs.gymnasium.simulator import GymnasiumSimulator
from repaint_cli.errors import RenderError
from repaint_cli.policies.spaces import Spaces
from repaint_cli.runs.experiment import Experiment
from repaint_cli.runs.plan import Plan
from repaint_cli.tasks.card_files import read_task
from repaint_cli.zoo.view_names import TeacherFile

SCRATCH = ["transfer", "--task", "reacher", "--method", "scratch", *QUICK]


def strict(text):
    """Read JSON as strict readers do, which know no NaN."""

    def refuse(word):
        raise ValueError(word)

    return json.loads(text, parse_constant=refuse)


def test_version_and_help(repaint):
    assert repaint("--version").out == f"repaint {__version__}\n"
    said = repaint("--help")
    assert said.code == 0
    for name in (
        "train-teacher",
        "transfer",
        "eval",
        "similarity",
        "compare",
        "open",
        "tasks",
        "zoo",
    ):
        assert f" {name} " in said.out


@pytest.mark.parametrize("command", ["train-teacher", "transfer", "eval", "compare"])
def test_help_names_every_option_whole_on_a_terminal_of_80_columns(repaint, monkeypatch, command):
    monkeypatch.setenv("COLUMNS", "80")
    said = repaint(command, "--help").out
    assert max(map(len, said.splitlines())) <= 80
    for parameter in typer.main.get_command(app).commands[command].params:
        if parameter.opts[0].startswith("--"):
            assert f"{parameter.opts[0]} " in said


def test_an_iteration_is_a_line_where_there_is_no_terminal(repaint):
    lines = repaint(*SCRATCH, "--run", "run").out.splitlines()
    assert [line.partition(" · ")[0] for line in lines[:2]] == ["iteration 1/2", "iteration 2/2"]
    assert "ppo" in lines[0]
    assert "steps/s · return -" in lines[0]
    assert lines[2].startswith("wrote run/: ")
    assert len(lines) == 4


def test_a_terminal_shows_what_is_done_and_the_newest_numbers(repaint, monkeypatch):
    terminal = Console(file=io.StringIO(), force_terminal=True, width=80, highlight=False)
    monkeypatch.setattr(screen, "out", terminal)
    repaint(*SCRATCH, "--run", "run", "--iterations", 8)
    shown = terminal.file.getvalue()
    for words in ("scratch · reacher", "/8 iterations", "steps/s · return -", "iteration 8/8 · "):
        assert words in shown
    assert "iteration 7/8" not in shown


def test_numbers_of_an_iteration_fit_on_a_line(repaint):
    said = repaint(
        "transfer", "--task", "racer-inner", "--method", "scratch", "--run", "run", *QUICK_LAP
    )
    assert all(len(line) <= 80 for line in said.out.splitlines() if line.startswith("iteration"))


def test_eval_without_a_name_plays_the_newest_run(repaint, home):
    repaint(*SCRATCH, "--seeds", 2)
    said = repaint("eval", "--episodes", 3)
    (folder,) = (home / "runs" / "reacher").iterdir()
    assert said.code == 0
    assert "reacher · scratch · iteration 2" in said.out
    recorded = strict((folder / "eval.json").read_text())
    assert np.shape(recorded["returns"]) == (2, 3)
    assert recorded["seeds"] == [0, 1]
    assert sum(recorded["mean_terms"].values()) == pytest.approx(np.mean(recorded["returns"]))
    assert (folder / "eval-trajectories.png").read_bytes().startswith(b"\x89PNG")
    assert f"wrote {folder.relative_to(home)}/: eval.json, eval-trajectories.png\n" in said.out


def test_eval_plays_a_teacher_by_name_or_file_on_its_own_task_or_another(repaint, home):
    path = add_teacher(home / "home" / "zoo")
    repaint("tasks", "copy", "reacher-gentle", "gentler.toml")
    for what, task in (("old-hand", []), (path, []), ("old-hand", ["--task", "gentler.toml"])):
        said = repaint("eval", what, *task, "--episodes", 2)
        assert said.code == 0
        assert ("old-hand on gentler" if task else "old-hand\n") in said.out
    assert {folder.name for folder in (home / "runs").iterdir()} == {"reacher", "gentler"}


def test_eval_is_the_same_every_time_and_another_with_another_seed(repaint, home):
    add_teacher(home / "home" / "zoo")

    def returns(*words):
        repaint("eval", "old-hand", "--episodes", 2, *words)
        newest = max((home / "runs" / "reacher").iterdir(), key=lambda path: path.stat().st_mtime)
        return strict((newest / "eval.json").read_text())["returns"]

    assert returns() == returns()
    assert returns() != returns("--seed", 9)


def test_eval_films_the_racer_and_leaves_the_run_alone(repaint, home):
    repaint("transfer", "--task", "racer-inner", "--method", "scratch", "--run", "run", *QUICK_LAP)
    before = files_below(home / "run")
    said = repaint("eval", "run", "--render-offscreen", "--episodes", 2)
    assert said.code == 0
    after = files_below(home / "run")
    assert after.keys() - before.keys() == {"eval.json", "eval-trajectories.png", "video.mp4"}
    assert before.items() <= after.items()
    assert "0 of 2" in said.out  # laps
    assert len(strict(after["eval.json"])["progress"][0]) == 2


def test_eval_keeps_its_other_files_where_nothing_renders(repaint, home, monkeypatch):
    add_teacher(home / "home" / "zoo")

    def fail(*_):
        raise RenderError("install libegl1")

    monkeypatch.setattr(GymnasiumSimulator, "film", fail)
    said = repaint("eval", "old-hand", "--render-offscreen", "--episodes", 2)
    assert (said.code, said.err) == (RenderError.exit_code, "error: install libegl1\n")
    assert "eval.json, eval-trajectories.png" in said.out
    assert sorted(Path(name).name for name in files_below(home / "runs")) == [
        "eval-trajectories.png", "eval.json"
    ]  # fmt: skip


@pytest.fixture
def two_runs(repaint, lay, home):
    add_teacher(home / "home" / "zoo")
    lay(*SCRATCH, "--run", "one")
    repaint("transfer", "--task", "reacher", "--teacher", "old-hand", "--run", "two", *QUICK)
    return home


def test_a_method_without_a_teacher_refuses_one(repaint, home):
    said = repaint(*SCRATCH, "--teacher", "nobody", "--run", "run")
    assert (said.code, said.err.count("\n")) == (2, 1)
    assert "that method 'scratch' uses, found --teacher; leave it out" in said.err
    assert not (home / "run").exists()


@pytest.mark.parametrize("method", ["warm-start", "kickstart", "instance", "repaint-joint"])
def test_every_method_runs(repaint, home, method):
    add_teacher(home / "home" / "zoo")
    words = ["transfer", "--task", "reacher", "--teacher", "old-hand", "--method", method]
    assert repaint(*words, *QUICK, "--run", "run").code == 0


def test_several_teachers_of_other_networks_with_a_beta_each(repaint, home):
    add_teacher(home / "home" / "zoo")
    add_teacher(home / "home" / "zoo", "narrow", settings=["net.hidden=[32,32]"])
    said = repaint(
        "transfer", "--task", "reacher", "--teacher", "old-hand", "--teacher", "narrow", "--run",
        "run", *QUICK, "--beta", "0.2,0.1", "--instances-from", "narrow",
    )  # fmt: skip
    assert said.code == 0
    record = json.loads((home / "run" / "run.json").read_text())
    recorded = [(teacher["name"], teacher["instances"]) for teacher in record["teachers"]]
    assert recorded == [("old-hand", False), ("narrow", True)]
    assert record["transfer"]["kickstart_coef"] == [0.2, 0.1]
    assert repaint("compare", "run").code == 0
    assert "repaint from old-hand and narrow" in repaint("compare", "run").out


QUICK_Q = ["--set", "q_learning.gradient_steps=5", "--set", "ppo.n_steps=1004"]


def test_q_learning_is_an_algorithm_with_instances_or_without(repaint, home):
    spaces = Spaces((4,), 2, True)
    add_teacher(home / "home" / "zoo", "balancer", task="cartpole", spaces=spaces)
    words = ["transfer", "--task", "cartpole", "--algorithm", "q-learning", *QUICK_Q]
    words += ["--iterations", 2, "--eval-episodes", 2, "--set", "ppo.n_envs=2"]
    assert repaint(*words, "--teacher", "balancer", "--threshold", 0.5, "--run", "one").code == 0
    record = json.loads((home / "one" / "run.json").read_text())
    assert (record["algorithm"], record["method"]) == ("q-learning", "instance")
    assert record["task"]["q_learning"]["threshold"] == 0.5
    assert repaint(*words, "--method", "scratch", "--run", "two").code == 0
    assert "q-learning instance from balancer" in repaint("compare", "one", "two").out
    assert repaint("eval", "one").code == 0


@pytest.mark.parametrize(
    "words",
    [
        *(["--select", rule] for rule in ("abs", "top", "per", "rbt", "all")),
        *(["--objective", objective] for objective in ("a2c", "trpo", "reinforce")),
        ["--preset", "coach"],
        ["--preset", "paper", "--set", "ppo.n_steps=204"],
        ["--set", "transfer.kickstart_schedule=linear", "--set", "transfer.alpha_power=0.5"],
    ],
    ids=" ".join,
)
def test_every_choice_runs(repaint, home, words):
    add_teacher(home / "home" / "zoo")
    command = ["transfer", "--task", "reacher", "--teacher", "old-hand", *QUICK, "--run", "run"]
    assert repaint(*command, *words).code == 0


def test_objectives_without_a_bound_use_each_sample_once_unless_told_otherwise(repaint, home):
    words = [*SCRATCH[:5], "--iterations", 1, "--eval-episodes", 1, "--set", "ppo.n_steps=204"]
    words += ["--set", "ppo.n_envs=4", "--objective", "a2c"]
    repaint(*words, "--run", "one")
    repaint(*words, "--run", "two", "--set", "ppo.n_epochs=3")
    found = [json.loads((home / run / "run.json").read_text()) for run in ("one", "two")]
    assert [record["task"]["ppo"]["n_epochs"] for record in found] == [1, 3]


def test_a_preset_is_outranked_by_what_is_said(repaint, home):
    said = repaint(*SCRATCH, "--preset", "coach", "--set", "ppo.vf_coef=0.25", "--run", "run")
    assert said.code == 0
    ppo = json.loads((home / "run" / "run.json").read_text())["task"]["ppo"]
    assert (ppo["time_limit"], ppo["clip_decay"], ppo["vf_coef"]) == ("terminal", 488, 0.25)


@pytest.mark.parametrize("what", ["policy", "policy+value"])
def test_a_warm_start_may_leave_the_critic_and_set_the_spread_anew(home, what):
    path = add_teacher(home / "home" / "zoo")
    settings = [f"transfer.warm_start={what}", "transfer.warm_start_log_std=-0.5"]
    card = read_task("reacher").with_settings([*settings, "ppo.n_steps=204", "ppo.n_envs=4"])
    fresh = Experiment.prepare(Plan(card, "scratch", [0], home / "one")).learner.student.weights
    student = Experiment.prepare(
        Plan(card, "warm-start", [0], home / "two", (TeacherFile(path),))
    ).learner.student
    teacher = weights_of(path)
    for name, leaf in student.weights.items():
        if name == "policy.log_std":
            assert (leaf == -0.5).all()
        else:
            taken = name.startswith("policy.") or what == "policy+value"
            assert torch.equal(leaf[0], teacher[name][0] if taken else fresh[name][0]), name


@pytest.mark.parametrize(("least", "begun"), [(0.01, -2.0), (0.5, log(0.5))])
def test_a_warm_start_explores_at_least_so_much(home, least, begun):
    path = add_teacher(home / "home" / "zoo", settings=["net.log_std_init=-2"])
    settings = [f"transfer.warm_start_min_std={least}", "ppo.n_steps=204", "ppo.n_envs=4"]
    card = read_task("reacher").with_settings(settings)
    plan = Plan(card, "warm-start", [0], home / "two", (TeacherFile(path),))
    log_std = Experiment.prepare(plan).learner.student.weights["policy.log_std"]
    assert log_std.detach().numpy() == pytest.approx(begun)


def test_auto_needs_no_number_and_counts_what_it_looked_at(repaint, home):
    words = ["transfer", "--task", "reacher", "--teacher", "reacher-gentle", "--auto", *QUICK]
    narrow = ["--set", "net.hidden=[32,32]"]  # so that its weights are no start
    assert repaint(*words, *narrow, "--run", "run").code == 0
    assert repaint(*SCRATCH, *narrow, "--run", "scratch").code == 0
    record = json.loads((home / "run" / "run.json").read_text())
    assert record["transfer"]["kickstart_schedule"] == record["transfer"]["phases"] == "auto"
    assert record["task"]["select"]["rule"] == "auto"
    rows = [(home / run / "metrics.csv").read_text().splitlines() for run in ("run", "scratch")]
    column = rows[0][0].split(",").index("env_steps")
    counted, plain = ([int(row.split(",")[column]) for row in table[1:]] for table in rows)
    before = sum(one["steps"] for one in record["ranked"])
    assert before <= 1500  # of some 2,000 steps that the run has
    after = [a - b for a, b in zip(counted, plain, strict=True)]
    assert after == [before, before + 100]  # and 2 episodes after each iteration


@pytest.mark.parametrize(
    ("option", "word"), [("--beta", "auto"), ("--threshold", "auto"), ("--ratio", "auto")]
)
def test_each_may_be_automatic_alone(repaint, home, option, word):
    add_teacher(home / "home" / "zoo")
    words = ["transfer", "--task", "reacher", "--teacher", "old-hand", *QUICK, "--run", "run"]
    assert repaint(*words, option, word).code == 0


def test_options_reach_the_card_and_set_has_the_last_word(repaint, home):
    add_teacher(home / "home" / "zoo")
    said = repaint(
        "transfer", "--task", "reacher", "--teacher", "old-hand", "--run", "run", *QUICK,
        "--ratio", "2:3", "--beta", 0.4, "--beta-decay", 0.5, "--threshold", -0.25,
        "--transfer-iterations", 7, "--set", "transfer.kickstart_decay=0.75",
    )  # fmt: skip
    assert said.code == 0
    record = json.loads((home / "run" / "run.json").read_text())
    transfer, select = record["transfer"], record["task"]["select"]
    assert (transfer["representation"], transfer["instance"]) == (2, 3)
    assert (transfer["kickstart_coef"], transfer["kickstart_decay"]) == (0.4, 0.75)
    assert (transfer["iterations"], select["threshold"]) == (7, -0.25)


@pytest.mark.parametrize(
    "table", [TransferOptions, TrainTeacherOptions, EvaluateOptions, CompareOptions]
)
def test_set_stands_behind_every_option_that_sets_something(table):
    names = list(table._fields)
    after = names[names.index("set") + 1 :]
    kinds = table.__annotations__
    rules = [part for name in after for part in getattr(kinds[name], "__metadata__", ())]
    assert not [rule for rule in rules if getattr(rule, "setting", "")]


def test_ratio_and_seeds_are_read():
    assert parse_ratio("2:1") == (2, 1)
    assert parse_ratio("1:0") == (1, 0)
    assert seed_list(3, 2) == [3, 4]


def test_replace_replaces(repaint, home):
    words = ["train-teacher", "--task", "reacher", "--name", "mine", *QUICK]
    repaint(*words, "--run", "one")
    path = home / "home" / "zoo" / "mine.safetensors"
    before = path.read_bytes()
    assert repaint(*words, "--seed", 4, "--run", "two", "--replace").code == 0
    assert path.read_bytes() != before


def test_compare_draws_the_paths_of_several_tasks_on_one_track(repaint, home):
    for task, method in (("racer-outer", "scratch"), ("racer-inner", "scratch")):
        repaint("transfer", "--task", task, "--method", method, "--run", task, *QUICK_LAP)
    said = repaint("compare", "racer-outer", "racer-inner", "--trajectories")
    assert said.code == 0
    assert "racer-outer: scratch" in said.out
    assert "wrote ./: compare-trajectories.png" in said.out
    assert (home / "compare-trajectories.png").read_bytes().startswith(b"\x89PNG")
    outer, inner = strict(
        repaint("compare", "racer-outer", "racer-inner", "--trajectories", "--json").out
    )
    assert (outer["task"], inner["task"]) == ("racer-outer", "racer-inner")
    assert np.shape(outer["returns"]) == np.shape(outer["progress"]) == (1, 20)


def test_other_settings_for_an_evaluation_leave_the_runs_own_alone(repaint, home):
    repaint("transfer", "--task", "racer-inner", "--method", "scratch", "--run", "a", *QUICK_LAP)
    assert repaint("eval", "a").code == 0
    before = (home / "a" / "eval.json").read_bytes()
    said = repaint("eval", "a", "--set", "env.track=oval", "--set", "eval.action_noise=0.2")
    assert said.code == 0
    assert "env.track=oval, eval.action_noise=0.2" in " ".join(said.out.split())
    assert (home / "a" / "eval.json").read_bytes() == before
    (recorded,) = (home / "runs" / "racer-inner").glob("eval-set-*/eval.json")
    recorded = strict(recorded.read_text())
    assert (recorded["env"]["track"], recorded["eval"]["action_noise"]) == ("oval", 0.2)
    said = repaint("eval", "a", "--set", "env.track=nope")
    assert said.err == (
        "error: unknown track 'nope'; there are oval, reinvent-like, wide-loop, "
        "and files that end in .npy\n"
    )


def test_compare_draws_no_paths_of_several_places(repaint, lay, home):
    repaint("transfer", "--task", "racer-inner", "--method", "scratch", "--run", "a", *QUICK_LAP)
    lay(*SCRATCH, "--run", "b")
    said = repaint("compare", "a", "b", "--trajectories")
    assert said.code == 3
    assert said.err == (
        "error: expected runs on one track or in one environment, found Reacher-v5, reinvent-like\n"
    )
    assert repaint("compare", "b", "--trajectories", "--output", "paths.png").code == 0
    only_races = repaint("eval", "b", "--colour", "reward")
    assert "expected --colour with a racing task, found 'reacher'; leave it out" in only_races.err
    unknown = repaint("eval", "a", "--colour", "height")
    assert unknown.code == 2
    assert unknown.err == "error: expected --colour speed or reward, found 'height'\n"
    assert (home / "paths.png").exists()
