"""Views of a teacher through the commands: NAME:mirrored and NAME:both are policies like others."""

import csv
import json

import numpy as np
import pytest
import torch
from small_runs import QUICK, QUICK_LAP, add_teacher

from repaint_cli.errors import CardError, NotFound, TeacherMismatch, UsageError
from repaint_cli.learn.evaluation import evaluate
from repaint_cli.learn.seeding import Purpose
from repaint_cli.policies.mirror import BothViews, mirrored
from repaint_cli.policies.spaces import Spaces
from repaint_cli.runs.experiment import Experiment
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.reader import read_run
from repaint_cli.tasks.card_files import read_task
from repaint_cli.zoo import store
from repaint_cli.zoo.view_names import TeacherFile, find, in_view, split

pytestmark = pytest.mark.usefixtures("unpainted")  # no picture of a run is looked at

CAR = Spaces((120, 160, 1), 10, True)
LAP_NET = QUICK_LAP[QUICK_LAP.index("net.conv=[[4,8,8]]") :: 2]
REACHER = ["transfer", "--task", "reacher", *QUICK, "--run", "run"]


def read_metrics(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def record_of(home):
    return json.loads((home / "run" / "run.json").read_text())


def played_returns(network, task):
    """What three episodes of an evaluation return."""
    task = task.model_copy(update={"env": task.env.for_replay()})
    return evaluate(network, task, [0], 3, purpose=Purpose.SCORE).returns


@pytest.fixture
def old_hand(home):
    return add_teacher(home / "home" / "zoo")


@pytest.fixture
def driver(home):
    """A driver of the inner lane with a small network."""
    return add_teacher(home / "home" / "zoo", "driver", "racer-inner", CAR, LAP_NET)


@pytest.mark.parametrize(
    ("typed", "name", "view"),
    [
        ("racer-inner", "racer-inner", ""),
        ("racer-inner:mirrored", "racer-inner", "mirrored"),
        ("racer-inner@shipped:both", "racer-inner@shipped", "both"),
        ("runner:front-back", "runner", "front-back"),
        ("folder/a.safetensors:mirrored", "folder/a.safetensors", "mirrored"),
        ("c:/folder/a.safetensors", "c:/folder/a.safetensors", ""),
        ("runs/a:b", "runs/a:b", ""),
        ("a:É", "a:É", ""),
        ("a:", "a:", ""),
    ],
)
def test_a_view_stands_behind_a_colon(typed, name, view):
    assert split(typed) == (name, view)


def test_teachers_without_a_view_take_the_one_of_the_option():
    assert in_view(["a", "b:both"], "mirror") == ["a:mirrored", "b:both"]
    assert in_view(["a", "b:both"], "none") == ["a", "b:both"]


@pytest.mark.parametrize("method", ["kickstart", "instance", "repaint", "repaint-joint"])
def test_a_mirror_image_teaches(repaint, home, old_hand, method):
    """Its advice and its samples are those of the image's weights in a file of its own."""
    task = read_task("reacher")
    (symmetry,) = task.symmetries
    network, card = store.read_teacher(old_hand)
    card = card.model_copy(update={"name": "image"})
    store.add(mirrored(network, symmetry), 0, card, home / "home" / "zoo")
    words = [*REACHER, "--method", method]
    curves = {}
    for name in ("old-hand:mirrored", "image", "old-hand"):
        said = repaint(*words, "--teacher", name, "--run", name.replace(":", "-"))
        assert said.code == 0, said.err
        curves[name] = read_run(home / name.replace(":", "-")).returns
    np.testing.assert_allclose(curves["old-hand:mirrored"], curves["image"], rtol=1e-6)
    assert not np.allclose(curves["old-hand:mirrored"], curves["old-hand"], rtol=1e-6)


def test_a_run_says_the_view_and_goes_on_with_it(repaint, home, old_hand):
    said = repaint(*REACHER, "--teacher", "old-hand:mirrored")
    assert said.code == 0
    (teacher,) = record_of(home)["teachers"]
    assert (teacher["name"], teacher["view"]) == ("old-hand", "mirrored")
    assert read_run(home / "run").label == "repaint auto from old-hand:mirrored"
    assert repaint("transfer", "--resume", "run", "--iterations", 4).code == 0
    whole = [*REACHER[:-1], "whole", "--iterations", 4, "--teacher", "old-hand", "--view", "mirror"]
    assert repaint(*whole).code == 0
    assert np.array_equal(read_run(home / "run").returns, read_run(home / "whole").returns)


def test_both_images_of_a_teacher_teach_beside_each_other(repaint, home, old_hand):
    words = ["--teacher", "old-hand", "--teacher", "old-hand:mirrored"]
    said = repaint(*REACHER, *words, "--instances-from", "old-hand:mirrored")
    assert said.code == 0, said.err
    taught = [(teacher["view"], teacher["instances"]) for teacher in record_of(home)["teachers"]]
    assert taught == [("", False), ("mirrored", True)]
    other = [*REACHER[:-1], "other", "--teacher", "old-hand"]
    said = repaint(*other, "--instances-from", "old-hand:both")
    assert "expected --instances-from one of old-hand, found 'old-hand:both'" in said.err


def test_a_student_that_begins_as_an_image_lives_in_the_mirror(repaint, home, driver):
    """Its card says so, and with it its files, its evaluations and what it teaches."""
    words = ["transfer", "--task", "racer-outer", "--method", "warm-start", *QUICK_LAP]
    said = repaint(*words, "--teacher", "driver:mirrored", "--run", "run")
    assert said.code == 0, said.err
    assert record_of(home)["task"]["net"]["flip_images"] is True
    plan = Plan(
        read_run(home / "run").task, "warm-start", [0], home / "new",
        (TeacherFile(driver, "mirrored"),),
    )  # fmt: skip
    student = Experiment.prepare(plan).learner.student
    network, _ = store.read_teacher(driver)
    (symmetry,) = read_task("racer-outer").symmetries
    obs = torch.randint(256, (1, 5, 120, 160, 1), dtype=torch.uint8)
    with torch.no_grad():
        wanted = network.policy(symmetry.observe(obs)).mirrored(symmetry.actions)
        torch.testing.assert_close(student.policy(obs).log_probs, wanted.log_probs)
    written, card = store.read_teacher(home / "run" / "seed-0.safetensors")
    assert card.task.net.flip_images
    assert written.net.flip_images
    # who starts from this student as it is flips too; from its image, not
    again = [*words, "--teacher", "run/seed-0.safetensors"]
    assert repaint(*again, "--run", "again").code == 0
    assert read_run(home / "again").task.net.flip_images
    again[-1] += ":mirrored"
    assert repaint(*again, "--run", "back").code == 0
    assert not read_run(home / "back").task.net.flip_images
    assert repaint("eval", "run", "--episodes", 2).code == 0


def test_an_image_plays_as_the_teacher_does_in_the_mirror(repaint, home, old_hand):
    said = repaint("eval", "old-hand:mirrored", "--task", "reacher-away", "--episodes", 3)
    assert said.code == 0
    assert said.out.splitlines()[-1] == "next: repaint similarity old-hand reacher-away"
    assert said.out.splitlines()[0] == "old-hand:mirrored on reacher-away"
    (folder,) = (home / "runs" / "reacher-away").iterdir()
    assert folder.name.startswith("eval-old-hand-mirrored-")
    played = json.loads((folder / "eval.json").read_text())
    task = read_task("reacher-away")
    network, _ = store.read_teacher(old_hand)
    image = mirrored(network, task.symmetries[0])
    np.testing.assert_allclose(played["returns"], played_returns(image, task))


def test_both_views_play_as_one(repaint, home, old_hand):
    assert find("old-hand:both") == TeacherFile(old_hand, "both")
    assert repaint("eval", "old-hand:both", "--episodes", 3).code == 0
    (folder,) = (home / "runs" / "reacher").iterdir()
    played = json.loads((folder / "eval.json").read_text())
    network, card = store.read_teacher(old_hand)
    both = BothViews(network, mirrored(network, card.task.symmetries[0]))
    np.testing.assert_allclose(played["returns"], played_returns(both, card.task))


def test_both_views_are_refused_where_they_contradict_each_other(repaint, driver):
    said = repaint("eval", "driver:both", "--episodes", 2, "--task", "racer-inner")
    assert said.code == TeacherMismatch.exit_code
    assert said.err == (
        "error: teacher 'driver:both' would contradict itself: lane of task 'racer-inner' changes "
        "in the mirror; use driver or driver:mirrored\n"
    )


@pytest.mark.parametrize(
    ("words", "kind", "line"),
    [
        (
            [*REACHER, "--teacher", "old-hand:backwards"], NotFound,
            "expected old-hand, old-hand:mirrored, old-hand:both, found the view 'backwards'",
        ),
        (
            [*REACHER, "--teacher", "old-hand:both", "--method", "warm-start"], TeacherMismatch,
            "a warm start needs one network, and 'old-hand:both' is two; leave out :both",
        ),
        ([*REACHER, "--teacher", "nobody:mirrored"], NotFound, "unknown teacher 'nobody'"),
        (
            [*REACHER, "--teacher", "old-hand", "--view", "left"], UsageError,
            "expected --view none, mirror, both, auto, found 'left'",
        ),
    ],
)  # fmt: skip
def test_what_a_view_cannot_be_is_said_in_a_line(repaint, home, old_hand, words, kind, line):
    said = repaint(*words)
    assert said.code == kind.exit_code
    assert line in said.err
    assert said.err.count("\n") == 1
    assert not (home / "run").exists()


def test_a_teacher_of_one_lane_is_not_both_in_a_task_that_knows_no_lane(repaint, home, driver):
    card = home / "mine.toml"
    card.write_text('extends = "racer-outer"\n[reward]\nlane = 0.0\nkeep = 1.0\n')
    said = repaint("eval", "driver:both", "--task", "mine.toml", "--episodes", 2)
    assert said.code == TeacherMismatch.exit_code
    assert "lane of task 'racer-inner' changes in the mirror" in said.err


def test_flipped_images_follow_from_the_teacher(repaint, home, driver):
    words = ["transfer", "--task", "racer-outer", "--method", "warm-start", *QUICK_LAP]
    said = repaint(*words, "--teacher", "driver", "--set", "net.flip_images=true", "--run", "run")
    assert said.code == CardError.exit_code
    assert "'driver' flips none; leave it out" in said.err
    said = repaint(*REACHER, "--method", "scratch", "--set", "net.flip_images=true")
    assert "net.flip_images: expected false where net.kind is mlp" in said.err


def test_the_name_to_type_is_one_that_finds_the_teacher(repaint, home, driver):
    """Also of a file outside the zoo, and of a shipped one behind the user's own."""
    words = ["transfer", "--task", "racer-outer", "--method", "kickstart", *QUICK_LAP]
    (home / "elsewhere").mkdir()
    driver.rename(home / "elsewhere" / "mine.safetensors")
    said = repaint(*words, "--teacher", "elsewhere/mine.safetensors")
    assert "--teacher elsewhere/mine.safetensors:mirrored" in "".join(said.out.split("\n"))
    card = [*words[:2], "racer-outer", "--method", "kickstart", "--iterations", 1, "--dry-run"]
    add_teacher(home / "home" / "zoo", "racer-inner", "racer-inner", CAR, LAP_NET)
    said = repaint(*card, "--teacher", "racer-inner@shipped:both")
    assert "teacher 'racer-inner@shipped:both' would contradict itself" in said.err


@pytest.mark.parametrize("algorithm", ["ppo", "q-learning"])
def test_numbered_actions_are_mirrored_too(repaint, home, algorithm):
    add_teacher(home / "home" / "zoo", "pole", "cartpole", Spaces((4,), 2, True))
    words = ["transfer", "--task", "cartpole", "--algorithm", algorithm, "--iterations", 2]
    words += ["--method", "instance", "--eval-episodes", 2, "--set", "ppo.n_steps=1200"]
    words += ["--set", "ppo.n_envs=2"]
    if algorithm == "q-learning":
        words += ["--set", "q_learning.gradient_steps=20"]
    said = repaint(*words, "--teacher", "pole:mirrored", "--run", "run")
    assert said.code == 0, said.err
    assert record_of(home)["teachers"][0]["view"] == "mirrored"


def test_both_images_of_cameras_and_lidar_teach(repaint, home):
    spaces = Spaces((120, 160, 2), 10, True, 64)
    add_teacher(home / "home" / "zoo", "racer", "racer-avoid", spaces, LAP_NET, n_beams=64)
    words = ["transfer", "--task", "racer-advanced", *QUICK_LAP, "--teacher", "racer:both"]
    words += ["--set", "transfer.distill_epochs=2", "--set", "transfer.distill_mirrored=true"]
    said = repaint(*words, "--run", "run")
    assert said.code == 0, said.err
    rows = read_metrics(home / "run" / "metrics.csv")
    assert float(rows[0]["distill_cross_entropy"]) > 0
    assert rows[1]["distill_cross_entropy"] == ""


def test_weights_carry_the_signs(home, driver):
    task = read_task("racer-outer").with_settings(["net.conv=[[4,8,8]]", "net.dense=8"])
    for view, cosine in (("", -1.0), ("mirrored", 1.0)):
        plan = Plan(task, "kickstart", [0], home / "run", (TeacherFile(driver, view),))
        _, loaded = plan.check()
        (teacher,) = loaded.teachers
        own = dict(zip(task.reward, teacher.weights, strict=True))
        assert own["lane"] * task.reward["lane"] * cosine > 0


def test_a_card_s_own_symmetry_is_checked_before_a_run(repaint, home, old_hand):
    card = home / "mine.toml"
    card.write_text('extends = "reacher"\n[symmetry]\nobservation = [-1]\naction = [-1, -2]\n')
    said = repaint(*REACHER[:2], "mine.toml", *REACHER[3:], "--teacher", "old-hand")
    assert said.code == CardError.exit_code
    assert "[symmetry] observation: expected 10 numbers" in said.err
    assert not (home / "run").exists()


def test_a_view_that_a_list_of_actions_does_not_have(repaint, home, driver):
    card = home / "mine.toml"
    card.write_text('extends = "racer-outer"\nenv.actions = [[-30, 1], [0, 1], [15, 1]]\n')
    spaces = Spaces((120, 160, 1), 3, True)
    add_teacher(home / "home" / "zoo", "odd", "mine.toml", spaces, LAP_NET)
    said = repaint("eval", "odd:mirrored", "--episodes", 2)
    assert said.code == NotFound.exit_code
    assert "'odd:mirrored' is not to be had: expected a mirror image of each of env.act" in said.err
    assert said.err.endswith("use odd\n")
    assert said.err.count("\n") == 1


def test_an_opposed_teacher_whose_image_is_similar_is_named(repaint, home, driver):
    words = ["transfer", "--task", "racer-outer", "--method", "kickstart", *QUICK_LAP]
    said = repaint(*words, "--teacher", "driver")
    wanted = "cosine -1.00), its mirror image is similar (1.00): --teacher driver:mirrored"
    assert wanted in " ".join(said.out.split())
    assert "its mirror image" not in repaint(*words, "--teacher", "driver:mirrored").out


def test_similarity_up_to_symmetry(repaint):
    said = repaint("similarity", "racer-inner", "racer-outer")
    assert said.out.splitlines() == [
        "racer-inner → racer-outer  -1.000  different",
        "racer-inner:mirrored → racer-outer  1.000  similar",
        "try: repaint transfer --teacher racer-inner:mirrored --task racer-outer",
    ]
    (pair,) = json.loads(repaint("similarity", "racer-inner", "racer-outer", "--json").out)
    assert (pair["cosine"], pair["views"]) == (-1.0, {"mirrored": 1.0})
    assert "-1.000~" in repaint("similarity", "racer-inner", "racer-outer", "racer-avoid").out
    assert len(repaint("similarity", "reacher", "reacher-gentle").out.splitlines()) == 1


def test_a_forward_runner_s_image_runs_backwards(repaint):
    """Exactly: front and back change places, and with them the sign of the speed."""
    said = repaint("similarity", "ant", "ant-back")
    assert said.out.splitlines() == [
        "ant → ant-back  0.500  similar",
        "ant:front-back → ant-back  1.000  similar",
        "train one first: repaint train-teacher --task ant",
    ]
    assert (
        "ant-forward-3 → ant-back  0.000  "
        in repaint("similarity", "ant-forward-3", "ant-back").out
    )
