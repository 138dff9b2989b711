"""The mini-games as tasks: the paper's numbers, every command on them, and what is refused."""

import json

import numpy as np
import pytest

from repaint_cli.envs.starcraft.build_timeline import Event
from repaint_cli.envs.starcraft.engines import table_of
from repaint_cli.errors import CardError, RenderError, TeacherMismatch
from repaint_cli.policies.weights import load
from repaint_cli.tasks.card_files import read_task
from repaint_cli.tasks.presets import with_preset
from repaint_cli.tasks.similarity import cosine, relation

STEPS = 6
"""Of an episode here."""
CARD = """
extends = "{task}"
summary = "A few seconds of it."
[env]
minutes = 0.05
[net]
conv = [[2, 8, 8], [4, 4, 2]]
vector = 4
dense = 8
[ppo]
n_iterations = 2
n_epochs = 1
learning_rate = 1e-3
[eval]
episodes = 2
"""


@pytest.fixture
def games(home):
    """The folder with two short games: marines (the teacher's), both (the student's)."""
    for name, task in {"marines": "build-marines", "both": "build-marines-fdz"}.items():
        (home / f"{name}.toml").write_text(CARD.format(task=task))
    return home


# -- the paper


def test_the_two_tasks_are_similar_and_one_a_part_of_the_other():
    marines, both = read_task("build-marines"), read_task("build-marines-fdz")
    assert cosine(marines, both) == pytest.approx(0.541, abs=5e-4)
    assert relation(marines, both) == "similar, sub-task"


@pytest.mark.parametrize("task", ["build-marines", "build-marines-fdz"])
def test_the_numbers_are_those_of_the_papers_table(task):
    card = read_task(task)
    paper = with_preset(card, "paper")
    for one in (card, paper):
        ppo, transfer = one.ppo, one.transfer
        assert (ppo.n_episodes, ppo.n_epochs, ppo.learning_rate) == (2, 6, 3e-5)
        assert (ppo.gamma, ppo.gae_lambda, ppo.ent_coef) == (0.99, 0.95, 0.01)
        assert (transfer.teacher_episodes, transfer.iterations) == (2, 25)
        assert (transfer.kickstart_coef, one.select.threshold) == (0.1, 0.2)


def test_the_network_has_the_size_of_sc2les_first():
    from repaint_cli.learn.evaluation import spaces_of
    from repaint_cli.policies.parameters import leaves_of

    card = read_task("build-marines")
    leaves = leaves_of(spaces_of(card.with_settings(["env.minutes=0.05"])), card.net)
    shapes = {leaf.name: leaf.shape for leaf in leaves["policy"]}
    assert shapes["policy.screen.conv0.weight"] == (16, 9, 8, 8)
    assert shapes["policy.minimap.conv1.weight"] == (32, 16, 4, 4)
    assert shapes["policy.vector.weight"] == (12, 64)
    assert shapes["policy.dense.weight"] == (2 * 32 * 9 * 9 + 64, 256)
    assert shapes["policy.head.weight"] == (256, 7 + 84 + 84)
    masked = card.with_settings(["net.mask=true"])  # which needs observations of what is available
    assert leaves_of(spaces_of(masked), masked.net) == leaves
    assert 1.40e6 < sum(np.prod(shape) for shape in shapes.values()) < 1.44e6


# -- every command


def test_every_command_works_on_it(games, repaint):
    assert "marines is sound" in repaint("tasks", "check", "marines.toml").out

    trained = repaint("train-teacher", "--task", "marines.toml", "--run", "marines")
    assert trained.code == 0, trained.err
    assert (games / "home" / "zoo" / "marines.safetensors").is_file()

    words = ["--task", "both.toml", "--teacher", "marines"]
    for method, n in (("repaint", 2), ("kickstart", 1), ("instance", 1)):
        taught = repaint("transfer", *words, "--run", method, "--method", method, "--iterations", n)
        assert taught.code == 0, taught.err
    rows = (games / "repaint" / "metrics.csv").read_text().splitlines()
    assert [row.split(",")[2] for row in rows[1:]] == ["representation", "instance"]
    assert (games / "repaint" / "trajectories.png").is_file()

    played = repaint("eval", "repaint", "--render-offscreen")
    assert played.code == 0, played.err
    heads = ("marines", "killed", "lost", "barracks", "SCVs", "supply", "mined")
    assert " ".join(played.out.splitlines()[1].split()).endswith(" ".join(heads))
    assert (games / "repaint" / "video.mp4").stat().st_size > 5000
    outcomes = json.loads((games / "repaint" / "eval.json").read_text())
    assert outcomes["lengths"] == [[STEPS, STEPS]]
    assert len(outcomes["minerals_mined"][0]) == 2

    alike = json.loads(repaint("similarity", "marines.toml", "both.toml", "--json").out)
    assert alike[0]["cosine"] == pytest.approx(0.541, abs=5e-4)

    drawn = repaint("compare", "repaint", "kickstart", "--trajectories")
    assert drawn.code == 0, drawn.err
    assert (games / "compare-trajectories.png").is_file()

    assert "marines: sound; score" in repaint("zoo", "verify", "marines", "--score").out
    exported = repaint("zoo", "export", "marines", "out")
    assert exported.code == 0, exported.err
    assert (games / "out" / "card.json").is_file()


def test_the_plain_command_works_on_it(games, repaint):
    assert repaint("train-teacher", "--task", "marines.toml", "--iterations", 1).code == 0
    taught = repaint(
        "transfer", "--task", "both.toml", "--teacher", "marines", "--run", "auto",
        "--iterations", 2,
    )  # fmt: skip
    assert taught.code == 0, taught.err
    assert len((games / "auto" / "metrics.csv").read_text().splitlines()) == 3


def test_a_run_that_goes_on_is_the_run_that_never_stopped(games, repaint):
    assert repaint("train-teacher", "--task", "marines.toml", "--iterations", 1).code == 0
    words = ["transfer", "--task", "both.toml", "--teacher", "marines", "--method", "repaint"]
    for name, first in (("whole", 2), ("parts", 1)):
        said = repaint(*words, "--run", name, "--iterations", first)
        assert said.code == 0, said.err
    assert repaint("transfer", "--resume", "parts", "--iterations", 2).code == 0
    whole, parts = (load(games / name / "checkpoint.safetensors")[0] for name in ("whole", "parts"))
    assert whole.keys() == parts.keys()
    for name, tensor in whole.items():
        assert tensor.numpy().tobytes() == parts[name].numpy().tobytes(), name


# -- what is refused


def test_a_teacher_of_other_layers_is_refused(games, repaint):
    text = CARD.format(task="build-marines").replace("[net]", 'layers = "coach-prefix"\n[net]')
    (games / "other.toml").write_text(text)
    assert repaint("train-teacher", "--task", "other.toml", "--iterations", 1).code == 0
    refused = repaint("transfer", "--task", "both.toml", "--teacher", "other")
    assert refused.code == TeacherMismatch.exit_code
    assert "screen-coach-prefix 84×84×9" in refused.err
    assert refused.err.count("\n") == 1


def test_the_game_itself_is_not_filmed(games):
    env = read_task("both.toml").with_settings(["env.engine=pysc2"]).env
    with pytest.raises(RenderError, match="the game has its own replays"):
        env.film(None, games / "film.mp4", "x", 1)


# -- engines


def test_engines_are_compared_by_when_things_came(games, repaint):
    longer = (games / "marines.toml").read_text().replace("minutes = 0.05", "minutes = 3.5")
    (games / "longer.toml").write_text(longer)
    said = repaint("tasks", "check", "longer.toml", "--engine", "mini")
    assert said.code == 0, said.err
    heads, *events, last = [line.split() for line in said.out.splitlines()]
    assert (heads, last) == (["mini,", "s"], ["marines", "1"])
    times = {" ".join(event[:-1]): float(event[-1]) for event in events}
    assert list(times.values()) == sorted(times.values())
    assert {"supply depot 1", "supply depot 2", "barracks 1", "barracks 4"} < times.keys()
    assert times["supply depot 1"] == pytest.approx(49, abs=2)  # walks, and builds for 30 s
    assert times["barracks 1"] - times["supply depot 1"] == pytest.approx(68, abs=3)  # 65 s
    assert times["marine 1"] == pytest.approx(208, abs=2)
    columns = {
        "pysc2": {("depot", 1): Event(800, "depot", 1), ("end", 3): Event(960, "end", 3)},
        "mini": {
            ("depot", 1): Event(768, "depot", 1), ("depot", 2): Event(900, "depot", 2),
            ("end", 2): Event(960, "end", 2),
        },
    }  # fmt: skip
    for _ in range(2):  # it takes nothing out of what it is given
        table = table_of(columns)
    assert [line.split() for line in table] == [
        ["pysc2,", "s", "mini,", "s"], ["depot", "1", "50.0", "48.0"], ["depot", "2", "-", "56.2"],
        ["marines", "3", "2"],
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("task", "engine", "message"),
    [
        ("marines.toml", "fake", "expected --engine mini or pysc2, found 'fake'"),
        ("both.toml", "mini", "expected the map build-marines for a build order"),
        ("reacher", "mini", "expected a task that has several engines, found 'gymnasium'"),
    ],
)
def test_engines_that_cannot_be_compared_are_named(games, repaint, task, engine, message):
    said = repaint("tasks", "check", task, "--engine", engine)
    assert said.code == CardError.exit_code
    assert message in said.err
