"""Cards for environments of Gymnasium: reward terms found by playing, rollouts that fit."""

import re

import gymnasium
import numpy as np
import pytest
from odd_envs import Odd

from repaint_cli.cli.new_card import _rollout_lines
from repaint_cli.envs.gymnasium.fitted_terms import fit_terms
from repaint_cli.envs.gymnasium.played import Played
from repaint_cli.files.paths import shipped_tasks
from repaint_cli.tasks.card_files import read_task

RNG = np.random.default_rng(0)
A, B, C = RNG.normal(size=(3, 500))
ZERO, ONE = np.zeros(500), np.ones(500)


def found(rewards, **numbers):
    return fit_terms(Played(rewards, numbers, []))


@pytest.mark.parametrize(
    ("rewards", "numbers", "weights"),
    [
        (A + B, {"near": A, "bonus": B, "x": C}, {"near": 1, "bonus": 1}),
        (A + B, {"reward_a": A, "reward_b": B, "a": A}, {"reward_a": 1, "reward_b": 1}),
        (A, {"x": A, "reward_a": A}, {"reward_a": 1}),  # what is called a reward goes first
        (A + B, {"reward_a": A, "bonus": B}, {"reward_a": 1, "bonus": 1}),
        (A + B, {"total_reward": A + B, "a": A, "b": B}, {"total_reward": 1}),
        (A - 0.1 * B, {"near": A, "effort": B, "x": C}, {"near": 1, "effort": -0.1}),
        (A + 2, {"near": A, "alive": ONE}, {"near": 1, "alive": 2}),
        ((A + B).astype(np.float32), {"near": A, "bonus": B}, {"near": 1, "bonus": 1}),
        (A + B, {"near": np.where(A > 0, A, np.nan), "bonus": B + A.clip(max=0)},
         {"near": 1, "bonus": 1}),  # a term that is left out is 0
        (A**2, {"near": A}, {}),
        (A + 0.001 * B, {"near": A, "reward_b": C}, {}),
        (A, {}, {}),
        (ONE, {"prob": ONE, "x": A}, {}),  # a constant may be anything
        (ONE, {"reward_survive": ONE, "x": A}, {"reward_survive": 1}),
        (ZERO, {"x": ZERO, "prob": ONE}, {}),
        (A, {f"reward_{i}": RNG.normal(size=500) for i in range(13)} | {"near": A}, {"near": 1}),
    ],
)  # fmt: skip
def test_terms_are_numbers_that_give_the_reward_exactly(rewards, numbers, weights):
    assert found(rewards, **numbers).weights == pytest.approx(weights)


def test_a_reward_that_was_never_paid_is_a_term_by_its_name_and_said_so():
    terms = found(A, reward_near=A, reward_goal=ZERO, hits=ZERO)
    assert terms.weights == {"reward_near": 1.0, "reward_goal": 1.0}
    assert terms.always_zero == ("reward_goal",)


@pytest.mark.parametrize(
    ("limit", "n_envs"), [(10, 40), (50, 40), (200, 10), (500, 4), (1000, 2), (2047, 1), (2048, 8)]
)
def test_rollouts_fit_the_time_limit(limit, n_envs):
    lines = _rollout_lines(limit)
    assert lines[-1] == f"n_envs = {n_envs}"
    assert ("goes on in the next rollout" in lines[0]) == (limit == 2048)


class Weighted(Odd):
    """Pays what is near, less a tenth of the effort; a goal is reported where it is met."""

    def pay(self, near, action):
        return near - 0.1 * float(action[0]) ** 2

    def report(self, near, action):
        met = {"goal met": 1.0} if near > -0.2 else {}
        return {"near": near, "effort": float(action[0]) ** 2} | met


class Endless(Odd):
    """Has no time limit."""


class Fails(Odd):
    def pay(self, near, action):
        raise RuntimeError("no power")


class Odds(Odd):
    observation_space = gymnasium.spaces.MultiBinary(3)


for kind in (Weighted, Fails, Odds):
    gymnasium.register(f"{kind.__name__}-v0", kind, max_episode_steps=10, disable_env_checker=True)
gymnasium.register("EndlessCard-v0", Endless)


def test_a_card_is_written_and_trains(repaint, home):
    said = repaint("tasks", "new", "--env", "Reacher-v5", "my.toml")
    assert (said.code, said.err) == (0, "")
    assert said.out == "wrote my.toml\nnext: repaint tasks check my.toml\n"
    text = (home / "my.toml").read_text()
    assert "add up to the environment's own reward in every step" in text
    card = read_task("my.toml")
    assert card.reward == {"reward_ctrl": 1.0, "reward_dist": 1.0}
    assert (card.ppo.n_steps, card.ppo.n_envs) == (2048, 40)
    said = repaint("tasks", "check", "my.toml")
    assert said.code == 0
    assert "warning" not in said.out


def test_weights_ranges_and_what_is_left_over_are_in_the_card(repaint, home):
    assert repaint("tasks", "new", "--env", "Weighted-v0", "my.toml").code == 0
    text = (home / "my.toml").read_text()
    assert "# These numbers of its infos, times the weight, add up to" in text
    assert "near = 1.0 # " in text
    assert "effort = -0.1 # " in text
    assert '# Other numbers of its infos, without weight: "goal met"' in text


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("kind", ["Strict", "Arrays", "Mixed", "Chatty", "Moves", "OwnReward"])
def test_odd_environments_get_a_card_that_is_sound(repaint, home, kind):
    said = repaint("tasks", "new", "--env", f"odd_envs:{kind}-v0", "my.toml")
    assert said.code == 0, said.err
    wanted = {"Mixed": "reward", "OwnReward": "reward", "Arrays": "list"}.get(kind, "near")
    assert read_task("my.toml").reward == {wanted: 1.0}
    assert repaint("tasks", "check", "my.toml").code == 0


@pytest.mark.parametrize(
    ("env", "code", "line"),
    [
        ("HalfCheeta-v5", 3, "gymnasium has no environment 'HalfCheeta-v5'.*HalfCheetah"),
        ("nowhere:Env-v0", 3, "gymnasium has no environment 'nowhere:Env-v0': No module"),
        ("EndlessCard-v0", 3, "has no time limit"),
        ("Fails-v0", 3, "the environment failed in a step: RuntimeError: no power"),
        ("Odds-v0", 3, "expected observations in a vector or an image"),
    ],
)
def test_what_no_card_can_be_written_for_is_one_line(repaint, home, env, code, line):
    said = repaint("tasks", "new", "--env", env, "my.toml")
    assert said.code == code
    assert said.err.count("\n") == 1
    assert re.search(line, said.err), said.err
    assert list(home.iterdir()) == []


def test_a_file_that_is_there_stays(repaint, home):
    (home / "my.toml").write_text("mine")
    said = repaint("tasks", "new", "--env", "Reacher-v5", "my.toml")
    assert (said.code, said.err) == (7, "error: my.toml exists already; give another name\n")
    assert (home / "my.toml").read_text() == "mine"
    assert repaint("tasks", "new", "--env", "Reacher-v5", "my.txt").code == 7


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("HalfCheetah-v5", "repaint tasks new --env HalfCheetah-v5 halfcheetah.toml"),
        ("a:Bee-v0", "repaint tasks new --env a:Bee-v0 bee.toml"),
        ("ALE/Pong-v5", "repaint tasks new --env ALE/Pong-v5 ale-pong.toml"),
        ("CartPole-v1", "cartpole.toml; or take one of its tasks: cartpole"),
    ],
)
@pytest.mark.parametrize("command", ["train-teacher --task", "tasks show", "similarity"])
def test_an_environments_id_where_a_task_is_wanted_leads_on(repaint, name, line, command):
    said = repaint(*command.split(), name)
    assert said.code == 2
    assert said.err.startswith("error: expected a task, found the id of an environment, ")
    assert said.err.endswith(f"{line}\n")


def test_no_shipped_task_is_called_as_environments_are():
    assert not [name for name in shipped_tasks() if "-v" in name[-4:]]
