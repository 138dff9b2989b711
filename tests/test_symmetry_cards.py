"""The symmetry that a card names: what it means, where it is kept, and what is refused."""

import json
import re
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.classic_control.pendulum import PendulumEnv

from repaint_cli.errors import CardError
from repaint_cli.policies.spaces import Spaces
from repaint_cli.symmetry import SignedPermutation
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.card_files import read_task

pytestmark = pytest.mark.usefixtures("unpainted")  # no picture of a run is looked at

MANUAL = Path(__file__).parents[1] / "docs" / "your-task.md"
CARD = """
extends = "cartpole"
summary = "A pole, and the pole in a mirror."

[env]
id = "{env}"

[reward]
reward = 1.0

[symmetry]
{symmetry}
"""
POLE = "observation = [-1, -2, -3, -4]\naction = [1, 0]"


def card_of(symmetry, env="CartPole-v1"):
    return CARD.format(env=env, symmetry=symmetry)


@pytest.fixture
def pole(home):
    (home / "pole.toml").write_text(card_of(POLE))
    return read_task("pole.toml")


def test_a_card_names_the_symmetry_that_the_simulator_knows(pole):
    assert pole.symmetries == read_task("cartpole").symmetries
    assert pole.task.symmetries == pole.symmetries
    assert pole.why_no_symmetry() is None


def test_what_a_card_names_comes_before_what_the_simulator_knows(home):
    (home / "pole.toml").write_text(card_of("observation = [1, 2, -3, -4]\naction = [1, 0]"))
    (named,) = read_task("pole.toml").symmetries
    assert named.vector == SignedPermutation.of([1, 2, -3, -4])
    assert read_task("pole.toml").task.symmetries == (named,)


def test_a_task_is_the_same_with_a_symmetry(pole):
    plain = read_task("cartpole")
    assert pole.task == plain.task
    assert hash(pole.task) == hash(plain.task)
    assert pole.task.difference(plain.task) is None


def test_a_card_with_a_symmetry_is_kept_whole(pole, home, repaint):
    again = TaskCard.parse(json.loads(pole.model_dump_json()), "again")
    assert again == pole
    assert again.symmetries == pole.symmetries
    (home / "shown").mkdir()
    (home / "shown" / "pole.toml").write_text(repaint("tasks", "show", "pole.toml").out)
    assert read_task("shown/pole.toml") == pole
    (home / "copied").mkdir()
    assert repaint("tasks", "copy", "pole.toml", "copied/pole.toml").code == 0
    assert read_task("copied/pole.toml").symmetry == pole.symmetry
    set_again = pole.with_settings(["symmetry.observation=[1, 2, -3, -4]"])
    assert set_again.symmetry.observation == (1, 2, -3, -4)


def test_a_card_without_one_is_written_as_ever(home):
    card = read_task("cartpole")
    assert card.symmetry is None
    assert "symmetry" not in card.model_dump()
    assert "symmetry" not in card.model_dump_json()


def test_a_run_and_its_teacher_keep_it(pole, home, repaint):
    tiny = ["--set", "ppo.n_steps=64", "--set", "eval.episodes=1", "--iterations", 1]
    assert repaint("train-teacher", "--task", "pole.toml", "--run", "r", *tiny).code == 0
    assert json.loads((home / "r" / "run.json").read_text())["task"]["symmetry"] == {
        "observation": [-1, -2, -3, -4], "action": [1, 0], "odd": []
    }  # fmt: skip
    teacher = json.loads(repaint("zoo", "show", "pole", "--json").out)
    assert teacher["task"]["symmetry"]["action"] == [1, 0]


def test_the_manuals_example_is_a_reflection_of_its_environment(home):
    (block,) = re.findall(r"```toml\n([^`]*\[symmetry\][^`]*)```", MANUAL.read_text("utf-8"))
    (home / "pendulum.toml").write_text(block)
    (symmetry,) = read_task("pendulum.toml").symmetries
    env, mirror = gymnasium.make("Pendulum-v1"), gymnasium.make("Pendulum-v1")
    env.action_space.seed(0)
    obs, _ = env.reset(seed=0)
    mirror.reset(seed=0)
    mirror.unwrapped.state = -env.unwrapped.state
    for _ in range(100):
        action = env.action_space.sample()
        obs, reward, *_ = env.step(action)
        reflected, other, *_ = mirror.step(symmetry.act(action))
        assert np.abs(symmetry.observe(obs) - reflected).max() < 1e-5  # in float32
        assert abs(other - reward) < 1e-5


REFLECTION = "expected a reflection, which changes nothing when applied twice: "


@pytest.mark.parametrize(
    ("symmetry", "problem"),
    [
        (
            "observation = [2, 3, 1, 4]\naction = [1, 0]",
            f"pole.toml: symmetry.observation: {REFLECTION}2 stands at 1, so 1 must stand at 2, "
            "found [2, 3, 1, 4]",
        ),
        (
            "observation = [-2, 1, 3, 4]\naction = [1, 0]",
            f"pole.toml: symmetry.observation: {REFLECTION}-2 stands at 1, so -1 must stand at 2, "
            "found [-2, 1, 3, 4]",
        ),
        (
            "observation = [1, 2, 3, 5]\naction = [1, 0]",
            "pole.toml: symmetry.observation: expected each of 1 to 4 once, with a minus where a "
            "sign changes, found [1, 2, 3, 5]",
        ),
        (
            "observation = [0, 1, 2, 3]\naction = [1, 0]",
            "pole.toml: symmetry.observation: expected each of 1 to 4 once, with a minus where a "
            "sign changes, found [0, 1, 2, 3]",
        ),
        (
            "observation = []\naction = [1, 0]",
            "pole.toml: symmetry.observation: expected a number for each that the environment "
            "has, found []",
        ),
        (
            "observation = [-1, -2, -3, -4]\naction = [0, -1]",
            "pole.toml: symmetry.action: expected each of 0 to 1 once, found [0, -1]",
        ),
        (
            "observation = [-1, -2, -3, -4]\naction = [1, 2, 0]",
            f"pole.toml: symmetry.action: {REFLECTION}1 stands at 0, so 0 must stand at 1, "
            "found [1, 2, 0]",
        ),
        (
            f'{POLE}\nodd = ["speed"]',
            "pole.toml: symmetry.odd: expected terms that [reward] names, found ['speed']",
        ),
        (f"{POLE}\nactions = [1]", "pole.toml: unknown key 'symmetry.actions'"),
        (
            "observation = [-1, -2, -3]\naction = [1, 0]",
            "[symmetry] observation: expected 4 numbers, as the environment has, found 3",
        ),
        (
            "observation = [-1, -2, -3, -4]\naction = [1, 0, 2]",
            "[symmetry] action: expected 2 numbers, as the environment has, found 3",
        ),
        (
            "observation = [-1, -2, -3, -4]\naction = [-1]",
            "[symmetry] action: expected each of 0 to 1, as actions are numbered, found [-1]",
        ),
    ],
)
def test_a_wrong_symmetry_is_refused_in_a_line(home, repaint, symmetry, problem):
    (home / "pole.toml").write_text(card_of(symmetry))
    said = repaint("tasks", "check", "pole.toml")
    assert (said.code, said.out) == (CardError.exit_code, "")
    (line,) = said.err.splitlines()
    assert line.startswith(f"error: {problem}")


def test_numbered_actions_do_not_fit_a_vector_of_them(home, repaint):
    text = card_of("observation = [1, -2, -3]\naction = [0]", "Pendulum-v1")
    (home / "pole.toml").write_text(text)
    assert (
        "[symmetry] action: expected each of 1 to 1, with a minus where a sign changes, as actions "
        "are vectors, found [0]"
    ) in repaint("tasks", "check", "pole.toml").err
    (home / "pole.toml").write_text(text.replace("[0]", "[-1]"))
    assert repaint("tasks", "check", "pole.toml").code == 0


def test_images_have_no_symmetry_that_a_card_could_name(pole):
    with pytest.raises(CardError, match="expected observations in a vector, found 8×8×1"):
        pole.check_symmetry(Spaces((8, 8, 1), 2, True))


def test_bounds_that_the_mirror_changes_are_refused():
    named = TaskCard.parse(
        read_task("cartpole").model_dump()
        | {"symmetry": {"observation": [1], "action": [2, 1, -3]}},
        "card",
    ).symmetry
    named.check_bounds([0, 0, -1], [1, 1, 1])
    with pytest.raises(CardError, match="2 stands at 1, whose bounds of 0 to 1 are not those of 2"):
        named.check_bounds([0, -1, -1], [1, 1, 1])
    with pytest.raises(CardError, match="-3 stands at 3, whose bounds of 0 to 1 are not those of"):
        named.check_bounds([0, 0, 0], [1, 1, 1])


class Pushed(PendulumEnv):
    """A pendulum that is turned one way only."""

    def __init__(self):
        super().__init__()
        self.action_space = gymnasium.spaces.Box(0.0, 2.0, (1,), np.float32)


def test_a_check_of_a_task_compares_bounds(home, repaint):
    gymnasium.register("Pushed-v0", Pushed, max_episode_steps=5)
    text = card_of("observation = [1, -2, -3]\naction = [-1]", "Pushed-v0")
    (home / "pole.toml").write_text(text)
    try:
        said = repaint("tasks", "check", "pole.toml")
    finally:
        del gymnasium.registry["Pushed-v0"]
    assert said.code == CardError.exit_code
    assert "-1 stands at 1, whose bounds of 0 to 2 are not those of -1" in said.err


def test_a_racers_card_names_none(home, repaint):
    racer = f'extends = "racer-inner"\nsummary = "A lane."\n[symmetry]\n{POLE}\n'
    (home / "lane.toml").write_text(racer)
    said = repaint("tasks", "check", "lane.toml")
    assert said.code == CardError.exit_code
    assert "symmetry: expected none, as the simulator 'racer' knows its own" in said.err
