"""A simulator of a test's own, with one entry in the registry: every command works on it."""

import json

import pytest

from repaint_cli.envs.registry import REGISTRY
from repaint_cli.errors import RenderError

CARD = """
summary = "A point on a line should {aim}."
[env]
simulator = "line"
image = {image}
[reward]
{reward}
[net]
{net}
[ppo]
n_iterations = 2
n_steps = 24
n_envs = 2
n_epochs = 2
minibatch_size = 12
[eval]
episodes = 2
"""
NETS = {
    "vector": "hidden = [8]",
    "image": 'kind = "cnn"\nconv = [[4, 4, 2], [8, 3, 1]]\ndense = 16',
}
NETS["commands"] = NETS["image"] + "\nvector = 8\npool = 1\nmask = true"


@pytest.fixture(params=["vector", "image", "commands"])
def line(request, home, monkeypatch):
    """The folder with two cards of the new simulator: stay (near 0), go (to the right, near 0)."""
    monkeypatch.setitem(REGISTRY, "line", "line_simulator:LineSimulator")
    rewards = {"stay": "near = 1.0", "go": "near = 0.5\nright = 1.0"}
    for name, reward in rewards.items():
        image = str(request.param != "vector").lower()
        text = CARD.format(aim=name, image=image, reward=reward, net=NETS[request.param])
        if request.param == "commands":
            text = text.replace("image = true", "image = true\ncommands = true")
        (home / f"{name}.toml").write_text(text)
    return home


def test_every_command_works_on_it(line, repaint):
    assert "stay is sound" in repaint("tasks", "check", "stay.toml").out

    trained = repaint("train-teacher", "--task", "stay.toml", "--run", "stay")
    assert trained.code == 0, trained.err
    teacher = line / "home" / "zoo" / "stay.safetensors"
    assert teacher.is_file()

    # a teacher who was never paid for going right teaches a task that pays for it
    taught = repaint("transfer", "--task", "go.toml", "--teacher", "stay", "--run", "go",
                     "--method", "repaint")  # fmt: skip
    assert taught.code == 0, taught.err
    rows = (line / "go" / "metrics.csv").read_text().splitlines()
    assert [row.split(",")[2] for row in rows[1:]] == ["representation", "instance"]
    assert repaint("transfer", "--resume", "go", "--iterations", 3).code == 0
    assert len((line / "go" / "metrics.csv").read_text().splitlines()) == 4
    assert (line / "go" / "trajectories.png").is_file()

    played = repaint("eval", "go", "--render-offscreen")
    assert played.code == 0, played.err
    assert "last x" in played.out
    assert (line / "go" / "video.mp4").stat().st_size > 500
    assert len(json.loads((line / "go" / "eval.json").read_text())["last_x"][0]) == 2

    alike = json.loads(repaint("similarity", "stay.toml", "go.toml", "--json").out)
    assert alike[0]["cosine"] == pytest.approx(0.5 / 1.25**0.5)
    assert alike[0]["relation"] == "similar, sub-task"

    drawn = repaint("compare", "stay", "go", "--trajectories")
    assert drawn.code == 0, drawn.err
    assert (line / "compare-trajectories.png").is_file()

    verified = repaint("zoo", "verify", "stay", "--score")
    assert "stay: sound; score" in verified.out
    exported = repaint("zoo", "export", "stay", "out")
    assert exported.code == 0, exported.err
    assert (line / "out" / "card.json").is_file()


def test_a_teacher_that_masks_nothing_teaches_a_student_that_does(line, repaint):
    if "commands" not in (line / "go.toml").read_text():
        pytest.skip("there are no commands")
    unmasked = ["--set", "net.mask=false", "--set", "net.spatial=all"]
    assert repaint("train-teacher", "--task", "stay.toml", *unmasked).code == 0
    words = ["--method", "repaint", "--select", "all", "--run", "run"]
    assert repaint("transfer", "--task", "go.toml", "--teacher", "stay", *words).code == 0
    heads, *rows = (row.split(",") for row in (line / "run" / "metrics.csv").read_text().split())
    ratios = [float(row[heads.index("log_ratio")]) for row in rows if row[2] == "instance"]
    assert len(ratios) == 1
    assert abs(ratios[0]) < 3  # of commands that the student leaves out it would be -10,000


def test_a_term_that_it_cannot_pay_is_refused(line, repaint):
    (line / "odd.toml").write_text((line / "go.toml").read_text().replace("right", "left"))
    repaint("train-teacher", "--task", "stay.toml", "--iterations", 1)
    refused = repaint("transfer", "--task", "odd.toml", "--teacher", "stay")
    assert refused.code != 0
    assert "left" in refused.err


@pytest.mark.parametrize(("teacher", "target"), [("stay", "go"), ("go", "stay")])
def test_relevance_asks_what_each_was_paid_in_its_own_terms(line, repaint, teacher, target):
    if "image = true" in (line / "go.toml").read_text():
        pytest.skip("relevance is judged by distances between vectors")
    assert repaint("train-teacher", "--task", f"{teacher}.toml").code == 0
    taught = repaint(
        "transfer", "--task", f"{target}.toml", "--teacher", teacher, "--select", "rbt",
        "--run", "run",
    )  # fmt: skip
    assert taught.code == 0, taught.err
    last = (line / "run" / "metrics.csv").read_text().splitlines()[-1]
    assert last.split(",")[2] == "instance"
    card = json.loads((line / "run" / "run.json").read_text())["task"]
    assert list(card["reward"]) == (["near", "right"] if target == "go" else ["near"])


def test_a_simulator_of_two_methods_trains_and_is_compared_with_its_equals(
    home, repaint, monkeypatch
):
    monkeypatch.setitem(REGISTRY, "bare", "line_simulator:BareSimulator")
    card = CARD.format(aim="stay", image="false", reward="near = 1.0", net=NETS["vector"])
    card = card.replace('"line"\nimage = false', '"bare"')
    (home / "stay.toml").write_text(card)
    (home / "long.toml").write_text(card.replace('"bare"', '"bare"\nsteps = 6'))
    assert repaint("train-teacher", "--task", "stay.toml", "--run", "stay").code == 0
    assert repaint("eval", "stay").code == 0
    filmed = repaint("eval", "stay", "--render-offscreen")
    assert filmed.code == RenderError.exit_code
    assert "the simulator 'bare' has no films" in filmed.err
    assert repaint("similarity", "stay.toml", "stay.toml").code == 0
    # only a running environment shows its terms, so another time limit may mean other ones
    assert "not comparable" in repaint("similarity", "stay.toml", "long.toml").out
