"""The examples of docs/extending.md: a selection rule, a method, a figure.

Those of a simulator and a course are tests/test_new_simulator.py and tests/test_course.py.
"""

import json
from typing import Annotated, NamedTuple

import numpy as np
from small_learners import course_for, learner_of, teachers_of, untrained_teacher
from small_runs import add_teacher
from small_tasks import reach

import repaint_cli as repaint
from repaint_cli.cli.evaluate import EvaluateOptions, evaluate
from repaint_cli.cli.option_rules import Rule
from repaint_cli.cli.zoo_add import SOURCES
from repaint_cli.learn.ppo import train
from repaint_cli.learn.transfer.selection import KEEPING_RULES
from repaint_cli.report import style
from repaint_cli.runs import figures
from repaint_cli.tasks.methods import ALGORITHMS, METHODS, Method
from repaint_cli.zoo.importers.imported import Imported
from repaint_cli.zoo.store import read_teacher

QUICK = ["ppo.n_steps=204", "ppo.n_envs=4", "ppo.n_epochs=1", "eval.episodes=2"]


def test_a_selection_rule_is_a_function_and_a_line(monkeypatch):
    """Keep the better half, and give the rule a name in settings.SelectConfig."""

    def better_half(samples, config, threshold):
        return samples.advantages >= samples.advantages.median(1, keepdim=True).values

    monkeypatch.setitem(KEEPING_RULES, "half", better_half)
    card = reach(n_iterations=2)
    select = card.select.model_copy(update={"rule": "half"})
    card = card.model_copy(update={"select": select})
    learner = learner_of(card, [0])
    _, instance = train(
        card, learner, course_for(card, learner, teachers_of(untrained_teacher(card)))
    )
    assert instance.phase == "instance"
    assert 0.5 <= instance.metrics["kept_fraction"][0] < 0.52


def test_a_method_is_a_row(home, monkeypatch):
    """Start from the teacher's weights and be advised by it, which no method of the paper does."""
    method = Method("warm-start with advice", warm_start=True, kickstart=True)
    monkeypatch.setitem(METHODS, "advised-start", method)
    monkeypatch.setitem(ALGORITHMS, "ppo", (*ALGORITHMS["ppo"], "advised-start"))
    add_teacher(home / "home" / "zoo")
    trained = repaint.transfer(
        "reacher", ["old-hand"], method="advised-start", iterations=1, settings=QUICK
    )
    assert trained.run.label == "advised-start from old-hand"
    assert trained.run.rows["kickstart_coef"].tolist() == [[0.2]]


def test_a_figure_is_a_function_and_a_line(home, monkeypatch):
    """Draw environment steps over iterations beside a run's other figures."""

    def draw_steps(run):
        figure = style.new_figure(5, 3)
        style.headline(figure, run.task.name)
        axes = figure.subplots()
        axes.plot(np.arange(1, run.returns.shape[1] + 1), run.rows["env_steps"].T)
        axes.set(xlabel="iteration", ylabel="environment steps")
        style.save(figure, run.folder / "steps.png")
        return [run.folder / "steps.png"]

    monkeypatch.setattr(figures, "RUN_FIGURES", (*figures.RUN_FIGURES, draw_steps))
    trained = repaint.transfer("reacher", method="scratch", iterations=1, settings=QUICK)
    assert trained.run.folder / "steps.png" in trained.written
    assert (trained.run.folder / "steps.png").is_file()


def test_an_option_of_eval_is_a_row_with_a_rule(home):
    """Its card's setting reaches the evaluation, which has a folder of its own."""
    add_teacher(home / "home" / "zoo")
    rows = EvaluateOptions.__annotations__ | {
        "control": Annotated[float, Rule("reward.reward_ctrl")]
    }
    options = NamedTuple("Options", list(rows.items()))
    values = EvaluateOptions._field_defaults | {"policy": "old-hand", "episodes": 2, "control": 7}
    evaluate.__wrapped__(options(**values))
    (path,) = home.glob("runs/reacher/eval-set-*/eval.json")
    summary = json.loads(path.read_text())
    assert summary["eval"]["episodes"] == 2
    assert summary["policy"] == "old-hand · reward.reward_ctrl=7"


def test_a_library_to_import_from_is_a_line(repaint, home, monkeypatch):
    """A reader of its files, and a name for it in SOURCES."""
    teacher = add_teacher(home)

    def read(file, card, spaces):
        network, _ = read_teacher(file)
        leaves = {name: leaf[0].detach() for name, leaf in network.weights.items()}
        return Imported(spaces, card.net, leaves, "ppo"), False

    monkeypatch.setitem(SOURCES, "ours", read)
    said = repaint("zoo", "add", "mine", teacher, "--from", "ours", "--task", "reacher")
    assert said.code == 0, said.err
    assert "score on reacher: " in said.out
