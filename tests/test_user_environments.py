"""Environments of users as they are: types, shapes, terms that come and go, and `tasks check`."""

import re

import numpy as np
import odd_envs
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from repaint_cli.envs.gymnasium.film import find_renderer
from repaint_cli.envs.numbers import number_of
from repaint_cli.errors import CardError
from repaint_cli.learn.evaluation import evaluate, spaces_of
from repaint_cli.learn.rollout.collect import clip
from repaint_cli.learn.task_check import check_task
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.tasks.card_files import read_task

CARD_ERROR, NOT_FINITE = 3, 6

pytestmark = pytest.mark.filterwarnings("default")  # as where users are


@pytest.fixture
def odd(home):
    """Write the card of an odd environment and read it."""

    def write(name, *terms, **options):
        (home / "odd.toml").write_text(odd_envs.card(name, *terms, **options))
        return read_task("odd.toml")

    return write


def first_steps(card, n_envs=3, n_steps=10, seeds=(1, 2, 3)):
    """Rewards and terms of some steps without a push, (T, N) and (T, N, F)."""
    env = card.make_env(n_envs)
    env.reset(seed=list(seeds)[:n_envs])
    still = np.zeros((n_envs, 1), np.float32)
    outcomes = [env.step(still) for _ in range(n_steps)]
    return np.stack([o[1] for o in outcomes]), np.stack([o[-1]["reward_terms"] for o in outcomes])


def checked(repaint, odd, name, *terms, **options):
    odd(name, *terms, **options)
    return repaint("tasks", "check", "odd.toml")


# Actions


@pytest.mark.parametrize("name", ["Strict", "Steps"])
def test_actions_are_of_their_space(repaint, odd, name):
    odd(name)
    said = repaint("transfer", "--task", "odd.toml", "--method", "scratch", "--run", "run")
    assert said.code == 0, said.err


@pytest.mark.parametrize("name", ["Strict", "Steps", "Wide"])
def test_clipped_actions_have_the_type_and_the_bounds_of_the_space(odd, name):
    env = odd(name).make_env(2)
    space = env.single_action_space
    drawn = np.array([[[-1e9], [-0.7], [0.2], [1.6], [1e9]]], np.float32)
    actions = clip(drawn, env)
    assert actions.dtype == space.dtype
    assert all(space.contains(action) for action in actions[0])
    if name == "Strict":  # nothing is lost: what is drawn is float32, and so are the bounds
        assert_array_equal(actions[0, 1:3], drawn[0, 1:3])
    if name == "Steps":
        assert actions.ravel().tolist() == [-2, -1, 0, 2, 2]


def test_envpools_actions_stay_as_they_were():
    pytest.importorskip("envpool", reason="the extra `mujoco` is absent")
    env = read_task("reacher").make_env(1)
    assert clip(np.ones((1, 1, 2), np.float32), env).dtype == np.float64


# Rewards and terms


@pytest.mark.parametrize(
    ("value", "number"),
    [
        (1, 1.0),
        (True, 1.0),
        (np.float32(0.5), 0.5),
        (np.array(2.0), 2.0),
        (np.array([[3]]), 3.0),
        ([4.0], 4.0),
        ("5", None),
        (np.array("5"), None),
        ([1.0, 2.0], None),
        ([[1.0], [2.0, 3.0]], None),
        ({"a": 1.0}, None),
        (None, None),
        (1j, None),
    ],
)
def test_what_is_a_number(value, number):
    assert number_of(value) == number


def test_arrays_of_one_number_are_numbers(odd):
    rewards, terms = first_steps(odd("Arrays", "near", "list", "reward"))
    plain, _ = first_steps(odd("Odd", "near"))
    assert_allclose(terms, np.repeat(plain[..., None], 3, axis=2))
    assert_allclose(rewards, 3 * plain)


def test_a_step_that_leaves_a_term_out_has_0_of_it(odd):
    rewards, _ = first_steps(odd("LeavesOut", "near"))
    plain, _ = first_steps(odd("Odd", "near"))
    plain[6] = 0
    assert_array_equal(rewards, plain)


def test_a_term_may_come_in_the_last_step_alone(repaint, odd):
    card = odd("LateBonus", "bonus")
    assert spaces_of(card.task).n_actions == 1
    assert first_steps(card)[0].T.tolist() == [[0] * 9 + [2.0]] * 3


def test_the_own_reward_is_the_own_reward_whatever_the_info_holds(odd):
    card = odd("OwnReward", "reward")
    policy = ActorCritic(spaces_of(card.task), card.net, 1)
    assert evaluate(policy, card, [0], 3).returns.tolist() == [[7.5] * 3]


def test_a_fraction_is_not_cut_off_where_another_copy_reports_an_integer(odd):
    _, terms = first_steps(odd("Mixed", "near"), n_envs=8, n_steps=1, seeds=range(8))
    assert set(terms.ravel()) == {1.0, 0.5}


@pytest.mark.parametrize(
    ("term", "found"),
    [
        ("word", "the text 'fast'"),
        ("list", "a list of 2"),
        ("table", "a table of a"),
        ("nothing", "None"),
    ],
)
def test_terms_that_are_no_numbers_are_named_by_training_and_by_the_check(
    repaint, odd, term, found
):
    line = f"expected a number as '{term}' in the environment's info, found {found}"
    said = checked(repaint, odd, "Mixed", term, "near")
    assert (said.code, line in said.err) == (CARD_ERROR, True), said.err
    said = repaint("train-teacher", "--task", "odd.toml")
    assert (said.code, line in said.err) == (CARD_ERROR, True), said.err
    assert said.err.count("\n") == 1


def test_a_term_that_never_comes_is_refused_after_an_episode(repaint, odd):
    line = "the environment reports no 'far' in 10 steps; its info has: near, reward"
    odd("Odd", "far", "near")
    said = repaint("train-teacher", "--task", "odd.toml")
    assert said.err == f"error: {line}\n"
    assert said.code == CARD_ERROR


# tasks check


def test_a_sound_card_has_one_line(repaint, odd):
    said = checked(repaint, odd, "Strict", "near")
    assert said.code == 0
    assert re.fullmatch(
        r"odd is sound: 2 observations and 1 continuous actions; 4 episodes of a first policy have "
        r"10 steps on average, at most 10; reward terms of a step: near -\d\.\d+\n",
        said.out,
    )
    assert not said.err


def test_all_findings_are_listed(repaint, odd):
    said = checked(repaint, odd, "NotFinite", "near", "heat", "reword")
    assert said.code == NOT_FINITE
    assert said.err.splitlines() == [
        "error: the reward term 'heat' is nan in step 4 of an episode",
        "the environment reports no 'reword' in 40 steps; its info has: heat, near, reward",
    ]


@pytest.mark.parametrize(
    ("name", "terms", "line"),
    [
        (
            "LeavesOut",
            ["near"],
            "the reward term 'near' is left out in 10 % of the steps, first in step 7 of an "
            "episode, and counts as 0 there",
        ),
        (
            "Wide",
            ["near"],
            r"action 0 has bounds of 0 to 100, and a first policy's actions are mostly within -2 "
            r"to 2: they reach 0 to \d.* of these; give the environment bounds of about -1 to 1 .*",
        ),
        (
            "Tiny",
            ["near"],
            r"feature 0 of the observations deviates by only 0\.00\d, far below net\.obs_min_std, "
            r"which is 0\.1: .* learn the slower; try --set net\.obs_min_std=0\.001",
        ),
        (
            "OwnReward",
            ["reward"],
            "all 4 episodes return 7.5: nothing tells a better action from a worse one yet",
        ),
        (
            "Float64",
            ["near"],
            r"the environment: reset\(\) returns observations of float64 where their space says "
            r"float32",
        ),
        (
            "Chatty",
            ["near"],
            r"the environment prints \d+ lines, such as 'a simulator of 1998'; in a training they "
            r"go to environment\.log in the run's folder",
        ),
        ("Chatty", ["near"], r"odd_envs\.py:\d+ warns: the belt is loose \(UserWarning\)"),
    ],
)
def test_what_training_would_stumble_over_is_a_line(repaint, odd, name, terms, line):
    said = checked(repaint, odd, name, *terms)
    assert said.code == 0, said.err
    lines = [re.fullmatch(f"warning: {line}", printed) for printed in said.out.splitlines()]
    assert sum(map(bool, lines)) == 1, said.out
    assert not said.err


def test_training_says_that_a_feature_is_hardly_seen_once(repaint, odd):
    odd("Tiny", "near")
    said = repaint("transfer", "--task", "odd.toml", "--method", "scratch", "--iterations", "2")
    assert said.out.count("try --set net.obs_min_std=0.001") == 1
    said = repaint(
        "transfer", "--task", "odd.toml", "--method", "scratch", "--set", "net.obs_min_std=0.001"
    )
    assert "obs_min_std" not in said.out
    assert said.code == 0


def test_nothing_is_hardly_seen_where_nothing_is_normalised(repaint, odd, home):
    odd("Tiny", "near")
    raw = ["--set", "net.obs_normalize=false"]
    said = repaint("transfer", "--task", "odd.toml", "--method", "scratch", *raw)
    assert (said.code, "obs_min_std" in said.out) == (0, False)
    path = home / "odd.toml"
    path.write_text(path.read_text().replace("[net]", "[net]\nobs_normalize = false"))
    said = repaint("tasks", "check", "odd.toml")
    assert (said.code, "obs_min_std" in said.out) == (0, False)


# Arguments and films


def test_arguments_may_be_lists_and_tables_and_each_copy_has_its_own(odd):
    arguments = '{ goals = [[0, 1], [2.5, 3]], options = { a = [true, "b"] } }'
    card = odd("Goals", "near", kwargs=arguments)
    first_steps(card)
    assert card.env.kwargs["goals"] == [[0, 1], [2.5, 3]]


@pytest.mark.skipif(find_renderer() is None, reason="neither EGL nor OSMesa renders here")
def test_a_users_own_environment_is_filmed(repaint, odd, home, monkeypatch):
    odd("Strict", "near")
    monkeypatch.setenv("PYTHONPATH", str(odd_envs.__file__).rpartition("/")[0])
    repaint("transfer", "--task", "odd.toml", "--method", "scratch", "--run", "run")
    said = repaint("eval", "run", "--render-offscreen")
    assert said.code == 0, said.err
    assert (home / "run" / "video.mp4").stat().st_size > 1000


# Paths


def test_the_path_of_a_position_in_the_infos_is_drawn(repaint, odd, home):
    odd("Moves", "near")
    text = (home / "odd.toml").read_text()
    (home / "odd.toml").write_text(text.replace("[reward]", 'position = ["px", "py"]\n[reward]'))
    said = repaint("transfer", "--task", "odd.toml", "--method", "scratch", "--run", "run")
    assert said.code == 0, said.err
    assert (home / "run" / "trajectories.png").stat().st_size > 5000
    said = repaint("eval", "run")
    assert said.code == 0, said.err
    assert (home / "run" / "eval-trajectories.png").exists()


def test_a_path_has_the_position_after_each_step_and_a_gap_where_it_is_not_reported(odd):
    card = odd("Moves", "near").with_settings(['env.position=["px", "py"]'])
    episodes = evaluate(ActorCritic(spaces_of(card.task), card.net, 1), card, [0], 3)
    assert episodes.paths.shape == (1, 3, 10, 2)
    assert_array_equal(episodes.paths[0, :, :, 1], [[1, 2, 3, 4, np.nan, 6, 7, 8, 9, 10]] * 3)


def test_a_position_that_is_never_reported_is_refused(odd):
    card = odd("Moves", "near").with_settings(['env.position=["px", "pz"]'])
    line = "the environment reports no 'pz' in {} steps; its info has: near, px, py, reward"
    with pytest.raises(CardError, match=line.format(10)):
        spaces_of(card.task)
    (error,) = check_task(card).errors
    assert str(error) == line.format(40)
