"""A teacher of the user's own under a shipped name: said at each use, and both can be named."""

import json
import re
import shutil

import pytest
from small_runs import QUICK, add_teacher, weights_of

from repaint_cli.errors import StoreError
from repaint_cli.files import paths
from repaint_cli.learn.evaluation import spaces_of
from repaint_cli.runs.reader import read_run
from repaint_cli.tasks.card_files import read_task
from repaint_cli.tasks.card_text import to_toml
from repaint_cli.zoo import store

pytestmark = pytest.mark.usefixtures("unpainted")  # no picture of a run is looked at

USED = "note: teacher 'reacher' is your own; the shipped one is reacher@shipped\n"

SMALL = (
    "env.max_steps=6", "net.conv=[[4,8,8]]", "net.dense=8", "ppo.n_iterations=2",
    "ppo.n_episodes=3", "ppo.n_epochs=1", "eval.episodes=2",
)  # fmt: skip


@pytest.fixture
def small_races(home, monkeypatch):
    """Shipped racing tasks, and a shipped teacher, with which every command takes a moment."""
    package = home / "installed"
    shutil.copytree(
        paths.shipped("tasks") / "racer" / "tracks", package / "tasks" / "racer" / "tracks"
    )
    cards = [read_task(name).with_settings(list(SMALL)) for name in ("racer-inner", "racer-outer")]
    for card in cards:
        (package / "tasks" / f"{card.name}.toml").write_text(to_toml(card))
    monkeypatch.setattr(paths, "PACKAGE", package / "repaint_cli")
    add_teacher(package / "zoo", "racer-inner", "racer-inner", spaces_of(cards[0]))
    return home


def test_the_three_commands_run_as_typed_twice_in_a_row(repaint, small_races):
    for turn in (1, 2):
        said = repaint("train-teacher", "--task", "racer-inner")
        assert said.code == 0, said.err
        first, *rest = (line for line in said.out.splitlines() if line.startswith("note: "))
        replaced = "note: this will replace your teacher 'racer-inner' of 20"
        assert first.startswith(replaced) == (turn == 2)
        before, after, undo = [first, *rest][-3:]
        assert before == (
            "note: your teacher 'racer-inner' will stand before the shipped one, "
            "racer-inner@shipped"
        )
        assert re.fullmatch(
            "note: 'racer-inner' now is your own teacher, score [-0-9.]+; the shipped one is "
            "racer-inner@shipped", after
        )  # fmt: skip
        assert undo.endswith("repaint zoo remove racer-inner")
        said = repaint("transfer", "--teacher", "racer-inner", "--task", "racer-outer")
        assert said.code == 0, said.err
        note = "note: teacher 'racer-inner' is your own; the shipped one is racer-inner@shipped\n"
        assert note in said.out
        said = repaint("eval", "--render-offscreen")
        assert said.code == 0, said.err
        first, *_ = said.out.splitlines()
        label = r"racer-outer · repaint auto from racer-inner(:mirrored)? · iteration 2"
        assert re.fullmatch(label, first)
        assert "video.mp4" in said.out
    assert len(list((small_races / "runs" / "racer-inner").iterdir())) == 2


@pytest.fixture
def own(home):
    """A teacher of the user's own with the name of a shipped one."""
    return add_teacher(home / "home" / "zoo", "reacher")


def test_both_can_be_named_wherever_a_teacher_is(repaint, home, own):
    shipped = paths.shipped("zoo") / "reacher.safetensors"
    assert (store.find("reacher"), store.find("reacher@shipped")) == (own, shipped)
    assert store.teachers()["reacher@shipped"] == shipped
    words = ["transfer", "--task", "reacher", "--teacher", "reacher@shipped", *QUICK]
    words += ["--method", "repaint"]
    said = repaint(*words, "--run", "one")
    assert (said.code, "note: " in said.out) == (0, False)
    said = repaint(*words, "--run", "two", "--teacher", "reacher")
    assert (said.code, said.out.count(USED)) == (0, 1)
    record = json.loads((home / "two" / "run.json").read_text())
    assert [teacher["name"] for teacher in record["teachers"]] == ["reacher@shipped", "reacher"]
    said = repaint("transfer", "--resume", "two", "--iterations", 3)
    assert (said.code, said.out.count(USED)) == (0, 1)
    assert read_run(home / "two").label == "repaint from reacher@shipped and reacher"
    assert repaint("zoo", "export", "reacher@shipped", "out").code == 0
    assert weights_of(home / "out" / "reacher.safetensors").keys() == weights_of(shipped).keys()


@pytest.mark.parametrize(
    "words",
    [
        ["eval", "reacher", "--episodes", 1],
        ["zoo", "show", "reacher"],
        ["zoo", "verify", "reacher"],
        ["zoo", "export", "reacher", "out"],
    ],
    ids=lambda words: " ".join(map(str, words)),
)
def test_each_use_says_whose_it_is(repaint, home, own, words):
    said = repaint(*words)
    assert (said.code, said.err) == (0, USED)
    words[words.index("reacher")] = "reacher@shipped"
    said = repaint(*words)
    assert (said.code, said.err) == (0, "")


def test_a_list_names_both(repaint, own):
    rows = [line.split() for line in repaint("zoo", "list").out.splitlines()]
    assert [row[0] for row in rows if row[-1] == "yours"] == ["reacher"]
    assert "reacher@shipped" in [row[0] for row in rows if row[-1] == "shipped"]
    assert "reacher" not in [row[0] for row in rows if row[-1] == "shipped"]


def test_a_shipped_one_is_so_called_before_anybody_stands_before_it(repaint, home):
    assert store.find("racer-inner@shipped") == store.find("racer-inner")
    assert "did you mean reacher" in repaint("zoo", "show", "reach@shipped").err
    with pytest.raises(StoreError, match="comes with repaint"):
        store.remove("racer-inner@shipped")


def test_only_a_given_name_is_refused_where_it_is_taken(repaint, home, own):
    words = ["train-teacher", "--task", "reacher", *QUICK]
    said = repaint(*words, "--name", "reacher")
    assert said.code == StoreError.exit_code
    assert said.err.endswith("a teacher 'reacher' already; give another name, or --replace it\n")
    assert repaint("zoo", "add", "reacher", own).code == StoreError.exit_code
    before = own.read_bytes()
    assert repaint(*words, "--run", "run").code == 0
    assert own.read_bytes() != before
    add_teacher(own.parent, "other")
    said = repaint("train-teacher", "--resume", "run", "--iterations", 3, "--name", "other")
    assert said.code == StoreError.exit_code
    assert "a teacher 'other' already" in said.err


def test_a_zoo_that_cannot_be_read_stops_nobody_who_does_not_need_it(repaint, home, monkeypatch):
    def no_home():
        raise StoreError("expected a folder for your teachers")

    words = ["transfer", "--task", "reacher", "--method", "scratch", *QUICK, "--run", "run"]
    assert repaint(*words).code == 0
    shutil.rmtree(home / "home", ignore_errors=True)
    (home / "home" / "zoo").mkdir(parents=True)
    monkeypatch.setattr(store, "user_zoo", no_home)
    assert (repaint("eval", "run").code, repaint("eval", "run").err) == (0, "")
