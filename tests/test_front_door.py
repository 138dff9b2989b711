"""The functions of `repaint_cli`, called as a user would: what they return, write and refuse."""

import inspect
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import gymnasium
import matplotlib
import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose, assert_array_equal
from small_runs import QUICK, QUICK_LAP, add_teacher, files_below

import repaint_cli
from repaint_cli.envs.episodes import Episodes
from repaint_cli.errors import (
    CardError,
    CheckpointError,
    NotFound,
    RepaintError,
    StoreError,
    TeacherMismatch,
    UsageError,
)
from repaint_cli.files.paths import PACKAGE
from repaint_cli.policies.spaces import Spaces
from repaint_cli.report import style  # noqa: F401  whose import must leave matplotlib alone
from repaint_cli.runs import experiment
from repaint_cli.runs.carry_out import Watcher

SETTINGS = ["ppo.n_steps=204", "ppo.n_envs=4", "ppo.n_epochs=1", "eval.episodes=2"]
SHORT = {"iterations": 2, "settings": SETTINGS}
"""The options of `small_runs.QUICK`, in Python."""

SHORT_LAP = {
    "iterations": 2,
    "settings": [
        *("env.max_steps=6", "ppo.n_episodes=3", "ppo.n_epochs=1", "eval.episodes=2"),
        *("net.conv=[[4,8,8]]", "net.dense=8"),
    ],
}
"""The same for the racer."""

FUNCTIONS = {
    name: function
    for name, function in vars(repaint_cli).items()
    if inspect.isfunction(function) and not name.startswith("_")
}


@pytest.fixture(autouse=True)
def quiet(request, capsys):
    """Nothing is printed, unless a command is typed."""
    yield
    if "repaint" not in request.fixturenames:
        assert capsys.readouterr() == ("", "")


@pytest.fixture
def old_hand(home):
    """The file of a teacher in the user's zoo."""
    return add_teacher(home / "home" / "zoo")


@pytest.fixture(scope="module")
def scratch(tmp_path_factory):
    """A run from scratch, two seeds, which tests may copy."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("scratch"))
        patch.setenv("REPAINT_HOME", "home")
        trained = repaint_cli.transfer("reacher", method="scratch", seeds=range(2), **SHORT)
        return trained.run.folder.absolute()


@pytest.fixture
def folder(home, scratch):
    """A run from scratch, two seeds, where it would have been trained."""
    folder = Path("runs") / "reacher" / scratch.name
    shutil.copytree(scratch, folder, copy_function=shutil.copy)
    return folder


def in_python(code):
    """What a line of Python prints in a process of its own."""
    env = os.environ | {"PYTHONPATH": str(PACKAGE.parent)}
    command = [sys.executable, "-c", code]
    return subprocess.run(command, env=env, capture_output=True, text=True, check=True).stdout


def test_importing_it_imports_nothing_that_is_slow():
    slow = {"torch", "numpy", "pydantic", "numba", "gymnasium", "matplotlib", "rich", "typer"}
    code = f"import sys, repaint_cli; print(sorted({slow} & sys.modules.keys()))"
    assert in_python(code) == "[]\n"


def test_matplotlibs_settings_stay_the_users_own():
    assert matplotlib.rcParams["text.parse_math"]


def test_the_manual_has_a_row_for_every_function():
    section = (PACKAGE.parent / "docs" / "python.md").read_text(encoding="utf-8")
    for name, function in FUNCTIONS.items():
        assert f"\n| `{name}(" in section, name
        assert function.__doc__, name


def test_train_returns_the_run_and_puts_the_teacher_into_the_zoo(home):
    trained = repaint_cli.train("reacher", name="mine", folder="run", seeds=range(2), **SHORT)
    assert trained.run.returns.shape == (2, 2)  # seeds, iterations
    assert trained.run.seeds == [0, 1]
    assert trained.run.folder == Path("run")
    assert trained.teacher == home / "home" / "zoo" / "mine.safetensors"
    assert all(path.exists() for path in trained.written)
    assert {path.name for path in trained.written} == {
        "run.json", "metrics.csv", "checkpoint.safetensors", "best.safetensors",
        "seed-0.safetensors", "seed-1.safetensors", "mine.safetensors", "curves.png",
        "trajectories.png", "evaluations", "report.html",
    }  # fmt: skip
    teacher = repaint_cli.load_teacher("mine")
    assert teacher.card.task == repaint_cli.load_task("reacher").with_settings(
        ["ppo.n_iterations=2", *SETTINGS]
    )
    assert repaint_cli.load_teacher(trained.teacher).card == teacher.card


def test_a_folder_of_its_own_where_none_is_named(home):
    trained = repaint_cli.train("reacher", **SHORT)
    assert trained.run.folder.parent == Path("runs") / "reacher"
    assert {path.name for path in home.iterdir()} == {"home", "runs"}


def test_transfer_takes_teachers_by_name_or_path(home, old_hand):
    add_teacher(home / "home" / "zoo", "narrow", settings=["net.hidden=[32,32]"])
    student = repaint_cli.transfer(
        repaint_cli.load_task("reacher"), [old_hand, "narrow"], instances_from=["narrow"],
        folder=Path("run"), seeds=np.arange(3, 5), keep=2, **SHORT,
    )  # fmt: skip
    assert student.run.returns.shape == (2, 2)
    assert student.run.seeds == [3, 4]
    assert student.run.label == "repaint from old-hand and narrow"
    assert [one.instances for one in student.run.record.teachers] == [False, True]
    assert student.teacher is None
    assert (home / "run" / "checkpoint-00001.safetensors").is_file()


def test_auto_is_what_the_command_line_calls_auto(repaint, home, old_hand):
    words = ["--task", "reacher", "--teacher", "old-hand", *QUICK]
    assert repaint("transfer", *words, "--auto", "--run", "typed").code == 0
    repaint_cli.transfer("reacher", ["old-hand"], auto=True, folder="called", **SHORT)
    records = [json.loads((home / run / "run.json").read_text()) for run in ("typed", "called")]
    for key in ("task", "transfer", "automatic", "method"):
        assert records[0][key] == records[1][key]
    assert records[1]["automatic"]


def test_q_learning_is_an_algorithm(home):
    settings = ["q_learning.gradient_steps=5", "ppo.n_steps=1004", "ppo.n_envs=2"]
    trained = repaint_cli.transfer(
        "cartpole", method="scratch", algorithm="q-learning", iterations=1,
        settings=[*settings, "eval.episodes=2"],
    )  # fmt: skip
    assert trained.run.label == "q-learning scratch"
    assert trained.run.returns.shape == (1, 1)


@pytest.mark.parametrize(
    ("by_hand", "kept"),
    [
        ("transfer.kickstart_coef=0.2", {"kickstart_schedule": "geometric", "phases": "auto"}),
        ("transfer.instance=2", {"kickstart_schedule": "auto", "phases": "ratio"}),
        ("transfer.iterations=5", {"kickstart_schedule": "auto", "iterations": 5}),
        ("transfer.kickstart_decay=0.5", {"kickstart_schedule": "auto", "start": "untrained"}),
    ],
)
def test_auto_leaves_alone_what_is_set_by_hand(repaint, home, old_hand, by_hand, kept):
    settings = [*SETTINGS, by_hand]
    called = repaint_cli.transfer(
        "reacher", ["old-hand"], auto=True, iterations=1, settings=settings, folder="called"
    )
    words = ["--task", "reacher", "--teacher", "old-hand", *QUICK, "--iterations", 1]
    assert repaint("transfer", *words, "--auto", "--set", by_hand, "--run", "typed").code == 0
    record = json.loads((home / "typed" / "run.json").read_text())
    assert called.run.task.model_dump(mode="json") == record["task"]
    assert kept.items() <= record["task"]["transfer"].items()


def test_the_number_of_threads_stays_the_callers(home):
    class Threads(Watcher):
        def __init__(self):
            self.numbers = []

        def show(self, report, alarms):
            self.numbers.append(torch.get_num_threads())

    before, watcher = torch.get_num_threads(), Threads()
    folder = repaint_cli.transfer("reacher", method="scratch", watcher=watcher, **SHORT).run.folder
    torch.set_num_threads(2)
    try:
        repaint_cli.resume(folder, iterations=3, watcher=watcher)
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)
    assert watcher.numbers == [1, 1, 1]


def test_methods_that_are_interrupted_are_not_drawn(home, monkeypatch):
    real, calls = experiment.save_checkpoint, []

    def interrupted(*args):
        calls.append(args)
        if len(calls) == 2:
            raise KeyboardInterrupt
        real(*args)

    monkeypatch.setattr(experiment, "save_checkpoint", interrupted)
    card = repaint_cli.load_task("reacher").with_settings(["ppo.n_iterations=2", *SETTINGS])
    with pytest.raises(KeyboardInterrupt):
        list(repaint_cli.train_methods(card, ["scratch"], seeds=[0]))
    (folder,) = home.glob("runs/reacher/*/scratch")
    names = {path.name for path in folder.iterdir()}
    assert names == {
        "run.json", "metrics.csv", "checkpoint.safetensors", "best.safetensors", "evaluations"
    }  # fmt: skip


class Notes(Watcher):
    """Notes what happens."""

    def __init__(self):
        self.events = []

    def begin(self, experiment):
        self.events.append("begin")

    def show(self, report, alarms):
        self.events.append((report.stats.iteration, report.evaluation.returns.shape))

    def end(self, experiment, cause):
        self.events.append(cause)

    def finish(self, trained, interrupted):
        self.events.append(trained)


def test_a_watcher_follows_the_training(home):
    notes = Notes()
    trained = repaint_cli.train("reacher", watcher=notes, **SHORT)
    assert notes.events == ["begin", (1, (1, 2)), (2, (1, 2)), None, trained]


def test_resume_goes_on_as_if_it_had_never_stopped(folder):
    longer = repaint_cli.resume(folder, iterations=3)
    assert longer.run.returns.shape == (2, 3)
    whole = repaint_cli.transfer(
        "reacher", method="scratch", seeds=range(2), iterations=3, settings=SETTINGS
    )
    assert_array_equal(longer.run.returns, whole.run.returns)


@pytest.mark.parametrize("policy", ["folder", "name", "file", None])
def test_evaluate_plays_a_run_or_a_teacher(home, folder, old_hand, policy):
    named = {"folder": folder, "name": "old-hand", "file": old_hand, None: None}[policy]
    evaluation = repaint_cli.evaluate(named, episodes=3)
    n_seeds = 1 if policy in ("name", "file") else 2
    assert isinstance(evaluation.episodes, Episodes)
    assert evaluation.episodes.returns.shape == (n_seeds, 3)
    assert evaluation.episodes.actions.shape == (50, n_seeds, 3, 2)
    assert [path.name for path in evaluation.written] == ["eval.json", "eval-trajectories.png"]
    assert all(path.is_file() for path in evaluation.written)
    summary = json.loads(evaluation.written[0].read_text())
    assert_allclose(summary["returns"], evaluation.episodes.returns)


def test_evaluate_takes_a_task_settings_and_a_seed(home, old_hand):
    task = repaint_cli.load_task("reacher-gentle")
    options = {"task": task, "episodes": 2, "settings": ["reward.reward_ctrl=5.0"]}
    one, same, other = (
        repaint_cli.evaluate("old-hand", seed=seed, **options).episodes for seed in (4, 4, 5)
    )
    assert_array_equal(one.returns, same.returns)
    assert (one.returns != other.returns).all()
    assert_allclose(one.returns, one.terms @ [1.0, 5.0])


def test_a_race_is_filmed_and_logged(home):
    trained = repaint_cli.train("racer-inner", name="mine", folder="run", **SHORT_LAP)
    evaluation = repaint_cli.evaluate(
        "run", keep_observations=True, log_folder="logs", noise="none", colour="reward"
    )
    film = evaluation.film()
    assert film == trained.run.folder / "video.mp4"
    assert film.stat().st_size > 500
    assert {path.parts[0] for path in evaluation.written} == {"run", "logs"}
    assert all(path.is_file() for path in evaluation.written)
    with pytest.raises(CardError, match="keep_observations=True"):
        repaint_cli.evaluate("run").film()


def test_similarity_takes_names_files_and_cards(home, old_hand):
    task = repaint_cli.load_task("reacher-away")
    alike = repaint_cli.similarity("reacher-gentle", old_hand, task)
    assert [card.name for card in alike.tasks] == ["reacher-gentle", "reacher", "reacher-away"]
    assert len(alike.pairs) == 6
    assert alike.pairs[0].cosine == pytest.approx(0.894, abs=5e-4)
    assert alike.pairs[0].relation == "similar"
    assert len(repaint_cli.similarity().tasks) == len(repaint_cli.similarity("reacher").tasks)


def test_train_methods_compare_and_play_runs(home, old_hand):
    card = repaint_cli.load_task("reacher").with_settings(["ppo.n_iterations=2", *SETTINGS])
    training = repaint_cli.train_methods(card, ["scratch", "kickstart"], ["old-hand"], range(2))
    assert not Path("runs").exists()  # nothing is trained before it is asked for
    folders = list(training)
    assert [folder.name for folder in folders] == ["scratch", "kickstart"]

    compared = repaint_cli.compare(folders)
    assert compared.written == [Path("compare.png")]
    assert list(compared.runs) == ["scratch", "kickstart from old-hand"]
    assert compared.comparison.reference == "scratch"
    assert [one.seeds for one in compared.comparison.standings] == [2, 2]
    named = repaint_cli.compare(
        folders, reference=folders[1], target=-9.0, picture="figures/mine.svg"
    )
    assert named.comparison.reference == "kickstart from old-hand"
    assert named.written == [Path("figures/mine.svg")]
    report = repaint_cli.compare(folders, report="report")
    assert {path.parts[0] for path in report.written} == {"report"}
    assert all(path.is_file() for path in [*named.written, *compared.written, *report.written])

    evaluated = repaint_cli.play_runs(folders, "paths.png")
    assert [one.episodes.returns.shape for one in evaluated] == [(2, 20), (2, 20)]
    assert Path("paths.png").is_file()


def test_a_teacher_acts_as_in_an_evaluation_one_observation_at_a_time(home):
    teacher = repaint_cli.load_teacher("reacher-gentle")
    episodes = repaint_cli.evaluate("reacher-gentle", episodes=2).episodes
    env = gymnasium.make("Reacher-v5")
    for e, seed in enumerate(episodes.env_seeds):
        observation, _ = env.reset(seed=seed)
        for t in range(50):
            action = teacher.act(observation)
            assert action.shape == (2,)
            assert_allclose(np.clip(action, -1, 1), episodes.actions[t, 0, e], atol=1e-4)
            observation, *_ = env.step(episodes.actions[t, 0, e])
    env.close()


@pytest.mark.parametrize("sensors", ["camera", "stereo+lidar"])
def test_a_teacher_acts_on_images_as_in_an_evaluation(home, sensors):
    task, shape, beams = "racer-inner", (120, 160, 1), 0
    if sensors != "camera":
        task, shape, beams = "racer-avoid", (120, 160, 2), 64
    spaces = Spaces(shape, len(repaint_cli.load_task(task).env.choices), True, beams)
    small = ["net.conv=[[4,8,8]]", "net.dense=8", "env.max_steps=8"]
    path = add_teacher(home, task=task, spaces=spaces, settings=small, n_beams=beams)
    teacher = repaint_cli.load_teacher(path)
    episodes = repaint_cli.evaluate(path, episodes=2, keep_observations=True).episodes
    for e in range(2):
        n = episodes.lengths[0, e] - 1
        after = episodes.observations[0][e]  # each step
        chosen = episodes.actions[1 : n + 1, 0, e]
        batch = {k: part[:n] for k, part in after.items()} if beams else after[:n]
        first = {k: part[0] for k, part in after.items()} if beams else after[0]
        assert teacher.act(batch).shape == (n,)
        assert_array_equal(teacher.act(batch), chosen)
        assert teacher.act(first) == chosen[0]


@pytest.mark.parametrize(
    "observations",
    [np.zeros(9), np.zeros((3, 9)), np.zeros((1, 3, 10)), np.zeros(()), {"camera": np.zeros(10)}],
)
def test_a_teacher_refuses_observations_of_other_shapes(observations):
    teacher = repaint_cli.load_teacher("reacher")
    assert teacher.act(np.zeros((3, 10))).shape == (3, 2)
    with pytest.raises(TeacherMismatch, match=r"teacher 'reacher' has 10 observations and 2 "):
        teacher.act(observations)


WRONG = [
    (NotFound, "unknown task 'reachr'", lambda: repaint_cli.load_task("reachr")),
    (NotFound, "there is no card at", lambda: repaint_cli.load_task(Path("my.toml"))),
    (NotFound, "unknown teacher", lambda: repaint_cli.load_teacher("nobody")),
    (CheckpointError, "broken", lambda: repaint_cli.load_teacher("broken.safetensors")),
    (UsageError, r"such as range\(3\), found 3", lambda: repaint_cli.train("reacher", seeds=3)),
    (UsageError, "each once", lambda: repaint_cli.train("reacher", seeds=[1, 1])),
    (UsageError, "each once", lambda: repaint_cli.transfer("reacher", seeds=[])),
    (UsageError, "at least 1 checkpoint", lambda: repaint_cli.train("reacher", keep=0)),
    (UsageError, "section.key=value", lambda: repaint_cli.train("reacher", settings=["gamma"])),
    (UsageError, "a list of settings", lambda: repaint_cli.train("reacher", settings="a.b=1")),
    (CardError, "ppo.n_iterations", lambda: repaint_cli.train("reacher", iterations=0)),
    (StoreError, "expected a teacher's name", lambda: repaint_cli.train("reacher", name="a/b")),
    (NotFound, "needs a teacher", lambda: repaint_cli.transfer("reacher")),
    (UsageError, "a list of teachers", lambda: repaint_cli.transfer("reacher", "reacher-gentle")),
    (TeacherMismatch, "fit", lambda: repaint_cli.transfer("cartpole", ["reacher"])),
    (NotFound, "unknown method", lambda: repaint_cli.transfer("reacher", method="magic")),
    (NotFound, "unknown algorithm", lambda: repaint_cli.transfer("reacher", algorithm="sarsa")),
    (UsageError, "method 'scratch' learns without a teacher: leave out reacher",
     lambda: repaint_cli.transfer("reacher", ["reacher"], method="scratch")),
    (UsageError, "'repaint' to be automatic, found 'scratch'",
     lambda: repaint_cli.transfer("reacher", method="scratch", auto=True)),
    (NotFound, "expected a run's folder", lambda: repaint_cli.resume("nowhere")),
    (NotFound, "expected a run below", lambda: repaint_cli.evaluate()),
    (CardError, "--noise", lambda: repaint_cli.evaluate("reacher", noise="paper")),
    (UsageError, "--seed", lambda: repaint_cli.evaluate("reacher", seed=-1)),
    (NotFound, "unknown task or teacher", lambda: repaint_cli.similarity("nothing")),
    (UsageError, "a list of methods", lambda: repaint_cli.train_methods("reacher", "scratch")),
    (UsageError, "each once, found scratch, scratch",
     lambda: repaint_cli.train_methods("reacher", ["scratch", "scratch"])),
    (UsageError, "at least 1 job",
     lambda: repaint_cli.train_methods("reacher", ["scratch"], jobs=0)),
    (UsageError, "a list of folders", lambda: repaint_cli.compare("one")),
    (NotFound, "expected a run's folder", lambda: repaint_cli.compare(["nowhere"])),
    (CardError, "found no run", lambda: repaint_cli.play_runs([])),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "message", "call"), WRONG)
def test_what_is_wrong_is_said_and_nothing_is_written(home, kind, message, call):
    Path("broken.safetensors").write_bytes(b"no teacher")
    before = files_below(home)
    with pytest.raises(kind, match=message) as caught:
        call()
    assert isinstance(caught.value, RepaintError)
    assert files_below(home) == before


TYPED = [
    ("train", ["train-teacher", "--task", "reacher", "--seeds", 2, "--seed", 3, "--name", "mine"],
     {"seeds": [3, 4], "name": "mine", "replace": False, "folder": None, "keep": 1}),
    ("transfer", ["transfer", "--task", "reacher", "--teacher", "old-hand", "--run", "run"],
     {"seeds": [0], "method": "repaint", "algorithm": "ppo", "folder": Path("run")}),
    ("resume", ["transfer", "--resume", "run", "--iterations", 5],
     {"iterations": 5, "for_teacher": False}),
    ("resume", ["train-teacher", "--resume", "run", "--name", "mine"],
     {"name": "mine", "for_teacher": True}),
    ("load_task", ["transfer", "--task", "reacher", "--method", "scratch"], {}),
    ("evaluate", ["eval", "reacher", "--episodes", 3, "--set", "env.backend=gymnasium"],
     {"episodes": 3, "settings": ["env.backend=gymnasium"], "keep_observations": False}),
    ("similarity", ["similarity", "reacher", "reacher-away"], {}),
    ("train_methods",
     ["compare", "--task", "reacher", "--methods", "scratch", "--jobs", 2, "--iterations", 1], {}),
    ("compare", ["compare", "one", "two", "--target", "5", "--report", "report"],
     {"target": (5.0,), "reference": None, "report": Path("report")}),
    ("play_runs", ["compare", "one", "two", "--trajectories"], {}),
]  # fmt: skip


@pytest.mark.parametrize(("name", "words", "options"), TYPED)
def test_a_command_is_a_call_of_its_function(repaint, monkeypatch, name, words, options):
    calls = []

    def stop(*values, **named):
        calls.append(inspect.signature(FUNCTIONS[name]).bind(*values, **named).arguments)
        raise RepaintError("stopped")

    monkeypatch.setattr(repaint_cli, name, stop)
    result = repaint(*words)
    assert result.code == 1
    assert result.err.splitlines()[-1] == "error: stopped"
    (arguments,) = calls
    assert options.items() <= arguments.items()


def test_every_function_that_a_command_could_call_is_called_by_one():
    assert FUNCTIONS.keys() - {name for name, *_ in TYPED} == {"load_teacher"}


def test_the_short_options_are_those_of_the_commands(repaint, home):
    for task, words, short in (("reacher", QUICK, SHORT), ("racer-inner", QUICK_LAP, SHORT_LAP)):
        typed, called = home / f"typed-{task}", home / f"called-{task}"
        command = ["transfer", "--task", task, "--method", "scratch", *words, "--run", typed]
        assert repaint(*command).code == 0
        repaint_cli.transfer(task, method="scratch", folder=called, **short)
        records = [json.loads((run / "run.json").read_text()) for run in (typed, called)]
        assert records[0]["task"] == records[1]["task"]
