"""A task is an environment and a reward; a card is a task and a recipe."""

import pytest
from small_runs import add_teacher

from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.files.paths import shipped_tasks
from repaint_cli.learn.evaluation import spaces_of
from repaint_cli.policies.spaces import Spaces
from repaint_cli.tasks.card_files import read_task
from repaint_cli.tasks.similarity import cosine
from repaint_cli.zoo.store import mismatch
from repaint_cli.zoo.teacher_card import read_card

CAMERA = Spaces((120, 160, 1), 10, True)


def inner(**weights):
    """The inner lane's card with these weights."""
    card = read_task("racer-inner")
    return card.model_copy(update={"reward": weights})


@pytest.mark.parametrize(
    "settings",
    [
        [],
        ["ppo.gamma=0.9", "net.dense=8", "eval.episodes=3", "transfer.iterations=2"],  # the recipe
        ["reward.fail=0"],  # a term that weighs 0
    ],
)
def test_equal_tasks_are_one_in_a_set(settings):
    card = read_task("racer-outer")
    other = card.with_settings(settings)
    assert card.task == other.task
    assert len({card.task, other.task}) == 1


@pytest.mark.parametrize(
    ("setting", "section"),
    [("env.track=oval", "env"), ("env.max_steps=9", "env"), ("reward.lane=2", "reward")],
)
def test_another_environment_or_weight_is_another_task(setting, section):
    card = read_task("racer-outer")
    other = card.with_settings([setting])
    assert card.task != other.task
    assert len({card.task, other.task}) == 2
    assert card.difference(other) == other.difference(card) == section


def test_the_time_limit_follows_from_the_track_and_the_slowest_action_unless_a_card_says_it():
    card = read_task("racer-inner")
    slow = card.with_settings(["env.actions=[[-15, 0.1], [0, 2], [15, 0.2]]"])
    a_lap = 15 * load_track(card.env.track).length / 0.1  # steps
    assert slow.env.longest_episode() == pytest.approx(1.5 * a_lap, abs=1)
    assert slow.with_settings(["env.max_steps=9"]).env.longest_episode() == 9
    shipped = [read_task(name) for name in shipped_tasks() if name.startswith("racer")]
    assert {one.env.longest_episode() for one in shipped} == {1500}
    assert card.with_settings(["env.max_steps=1500"]).task == card.task  # as runs before had it


@pytest.mark.parametrize(("limit", "said"), [
    (None, None),
    (400, None),
    (300, "a lap at the slowest action cannot be finished: it takes 360 steps at the slowest "
     "action's 0.5 m/s, and env.max_steps is 300"),
    (100, "no lap can be finished: it takes 180 steps at the fastest action's 1 m/s, and "
     "env.max_steps is 100; leave max_steps out"),
])  # fmt: skip
def test_a_card_whose_laps_take_longer_than_its_episodes_is_doubted(limit, said):
    settings = ["env.track=oval"] + ([] if limit is None else [f"env.max_steps={limit}"])
    doubts = read_task("racer-inner").with_settings(settings).env.doubts()  # 12 m at 0.5 and 1 m/s
    assert len(doubts) == (said is not None)
    assert all(line.startswith(said) for line in doubts)


def test_no_shipped_card_is_doubted():
    for name in shipped_tasks():
        if name.startswith("racer"):
            assert read_task(name).env.doubts() == []


def test_cards_of_one_task_may_differ():
    card = read_task("reacher")
    other = card.with_settings(["ppo.gamma=0.9"])
    assert card != other
    assert card == read_task("reacher")
    assert card.task == other.task


def test_a_lane_teacher_may_teach_a_task_that_pays_progress_too(home):
    """Similarity and transfer agree: what the simulator can pay and a card leaves out weighs 0."""
    path = add_teacher(home, "lane", "racer-inner", CAMERA)
    teacher = read_card(path)
    for target in (inner(lane=-1.0, dprog=10.0), inner(dprog=1.0)):
        assert mismatch(teacher, target, spaces_of(target)) is None
        assert cosine(teacher.task, target) is not None
    assert cosine(inner(lane=3.0), inner(lane=3.0, dprog=4.0)) == pytest.approx(0.6)
    assert inner(lane=3.0).weights(["dprog", "lane"]) == [0.0, 3.0]


def test_a_term_that_the_simulator_cannot_pay_is_a_misfit(home):
    teacher = read_card(add_teacher(home, "lane", "racer-inner", CAMERA))
    target = inner(lane=1.0, clear=1.0)  # there are no bots to be clear of
    assert "knows the reward terms lane, task 'racer-inner' has lane, clear" in mismatch(
        teacher, target, CAMERA
    )
    assert cosine(teacher.task, target) is None


def test_naming_a_term_changes_no_task():
    card = inner(lane=1.0)
    named = card.naming({"lane", "dprog"})
    assert named.reward == {"lane": 1.0, "dprog": 0.0}
    assert named.task == card.task
