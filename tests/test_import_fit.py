"""A policy acts in a task as it did where it was trained, or is refused with both sides."""

import gymnasium
import numpy as np
import pytest
import torch
from foreign_policies import ACTIONS, PICTURE, VECTOR, model, noise_env_id, task_of
from gymnasium.spaces import Box, Discrete
from gymnasium.wrappers import RescaleAction
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecFrameStack
from test_import_sb3 import assert_same_policy, saved, vectors

from repaint_cli.errors import CheckpointError, TeacherMismatch, UsageError
from repaint_cli.learn.evaluation import environment_spaces
from repaint_cli.zoo.importers import cleanrl, fit, sb3
from repaint_cli.zoo.importers.imported import as_teacher

LOW, HIGH = np.float32([-3, 0, -0.5]), np.float32([3, 2, 1])
MOTORS = Box(LOW, HIGH)
"""Another range for each motor."""


def imported(path, task, **settings):
    policy, _ = sb3.read(path)
    return as_teacher(policy, None, "guest", task, environment_spaces(task), **settings)


def refusal(path, task, kind=TeacherMismatch, **settings):
    with pytest.raises(kind) as refused:
        imported(path, task, **settings)
    text = str(refused.value)
    assert "\n" not in text
    return text


@pytest.mark.parametrize(
    ("there", "here", "found"),
    [
        (ACTIONS["box"], Box(-3, 3, (3,)), "action 1 of 3 is within [-1, 1], the task's within"
         " [-3, 3]"),
        (ACTIONS["box"], Box(np.float32([-1, -1, 0]), 1.0), "action 3 of 3 is within [-1, 1], the"
         " task's within [0, 1]"),
        (MOTORS, ACTIONS["box"], "action 1 of 3 is within [-3, 3], the task's within [-1, 1]"),
        (ACTIONS["box"], Box(-1, np.inf, (3,)), "action 1 of 3 is within [-1, 1], the task's within"
         " [-1, inf]"),
    ],
)  # fmt: skip
def test_other_bounds_of_actions_are_refused_with_both(tmp_path, there, here, found):
    text = refusal(saved(tmp_path, model(action=there)), task_of(VECTOR, here))
    assert f"teacher 'guest': its {found}" in text
    assert text.endswith("or --rescale-actions if it was trained behind gymnasium's RescaleAction")


@pytest.mark.parametrize(
    "action",
    [MOTORS, Box(-np.pi, np.float32(1e-7), (3,)), Box(-1, 1, (200,)), Box(-1e6, 1e-3, (3,))],
    ids=str,
)
def test_the_same_bounds_are_taken_whatever_their_digits(tmp_path, action):
    source = model(action=action)
    network, _ = imported(saved(tmp_path, source), task_of(VECTOR, action))
    seen = vectors() / 100
    assert_same_policy(source, network, seen, seen)
    actions, _ = source.predict(seen, deterministic=True)
    mode = network.policy(torch.from_numpy(seen)[None]).mode()[0].detach().numpy()
    assert np.abs(mode.clip(action.low, action.high) - actions).max() <= 1e-5


def test_a_policy_behind_rescaled_actions_acts_the_same_in_the_bare_environment(tmp_path):
    env = RescaleAction(gymnasium.make(noise_env_id(VECTOR, MOTORS)), np.float32(-1), np.float32(1))
    source = PPO("MlpPolicy", env, seed=3, device="cpu")
    with torch.no_grad():
        source.policy.action_net.weight *= 300
        source.policy.log_std += torch.tensor([0.3, -0.2, 0.1])
    path, task, seen = saved(tmp_path, source), task_of(VECTOR, MOTORS), vectors() / 100
    assert "is within [-1, 1]" in refusal(path, task)
    network, _ = imported(path, task, rescale=True)
    inner, _ = source.predict(seen, deterministic=True)
    assert (np.abs(inner) == 1).mean() > 0.05
    wanted = np.stack([env.action(action) for action in inner])
    ours = network.policy(torch.from_numpy(seen)[None])
    found = ours.mode()[0].detach().numpy().clip(MOTORS.low, MOTORS.high)
    assert np.abs(found - wanted).max() <= 1e-5

    drawn = torch.randn(len(seen), 3)  # a density per rescaled action
    scale, shift = torch.from_numpy((HIGH - LOW) / 2), torch.from_numpy((HIGH + LOW) / 2)
    with torch.no_grad():
        value, log_probs, _ = source.policy.evaluate_actions(torch.from_numpy(seen), drawn)
        mine = ours.log_prob((drawn * scale + shift)[None])[0] + scale.log().sum()
        assert (mine - log_probs).abs().max() <= 1e-4
        assert (network.value(torch.from_numpy(seen)[None])[0] - value[:, 0]).abs().max() <= 1e-5


def test_actions_are_rescaled_where_bounds_are_known_alone(tmp_path):
    text = refusal(saved(tmp_path, model()), task_of(VECTOR, Box(-1, np.inf, (3,))), rescale=True)
    assert "expected finite bounds with room between them, to rescale actions, found [-1, inf]" in (
        text
    )
    discrete = saved(tmp_path, model(action=Discrete(4)))
    text = refusal(discrete, task_of(VECTOR, Discrete(4)), UsageError, rescale=True)
    assert "expected --rescale-actions with a file that has the bounds of continuous" in text


@pytest.mark.parametrize("low", ["[-1. -1. ... -1.]", "[-1.]", "[2. 2. 2.]", "[nan 0. 0.]", None])
def test_bounds_that_cannot_be_read_are_refused(tmp_path, monkeypatch, low):
    path, spaces_of = saved(tmp_path, model()), sb3.spaces_of
    monkeypatch.setattr(
        sb3, "spaces_of",
        lambda data, file: spaces_of(
            data | {"action_space": data["action_space"] | {"low": low}}, file),
    )  # fmt: skip
    with pytest.raises(CheckpointError, match=r"expected the bounds of 3 actions, found .* and \["):
        sb3.read(path)


def test_pictures_of_other_pixels_are_refused(tmp_path):
    path = saved(tmp_path, model(policy="CnnPolicy", obs=PICTURE))
    text = refusal(path, task_of(Box(-np.inf, np.inf, PICTURE.shape), ACTIONS["box"]))
    assert text.endswith("it reads pixels from 0 to 255, uint8; the task's are float32")


@pytest.mark.parametrize("shape", [(2, 44, 40), (36, 36, 36)], ids=str)
def test_pictures_whose_channels_come_first_are_refused_with_both_shapes(tmp_path, shape):
    obs = Box(0, 255, shape, np.uint8)
    path = saved(tmp_path, model(policy="CnnPolicy", obs=obs))
    channels, height, width = shape
    assert (
        f"the pictures of a task have their channels last, {height}×{width}×{channels}; found "
        f"{channels}×{height}×{width}: let the environment transpose them"
    ) in refusal(path, task_of(obs, ACTIONS["box"]))


@pytest.mark.parametrize("obs", [VECTOR, PICTURE], ids=["vectors", "pictures"])
def test_stacked_frames_are_refused_where_the_task_gives_one(tmp_path, obs):
    venv = DummyVecEnv([lambda: gymnasium.make(noise_env_id(obs, ACTIONS["box"]))])
    policy = "CnnPolicy" if obs is PICTURE else "MlpPolicy"
    path = saved(tmp_path, PPO(policy, VecFrameStack(venv, 4), device="cpu"))
    both = "44×40×8 .* 44×40×2" if obs is PICTURE else "20 observations .* 5 observations"
    with pytest.raises(TeacherMismatch, match=both):
        imported(path, task_of(obs, ACTIONS["box"]))


def test_other_bounds_of_observations_are_noticed():
    task = task_of(VECTOR, ACTIONS["box"])
    wide = fit.Bounds(np.full(5, -3.4e38), np.full(5, np.inf))
    assert notice(None, task) is None
    assert notice(wide, task) is None
    one = fit.Bounds(np.full(5, -1.0), np.full(5, 1.0))
    assert notice(one, task).startswith(
        "observation 1 of 5 was within [-1, 1] in training, is within [-inf, inf] in 'dream': if a"
    )
    pictures = task_of(PICTURE, ACTIONS["box"])
    assert notice(one, pictures) is None


def notice(bounds, task):
    obs, _ = environment_spaces(task)
    return fit.observation_notice(bounds, obs, task.name)


def test_a_state_dict_has_no_bounds_and_its_actions_are_clipped_by_the_task(tmp_path):
    from test_import_cleanrl import Continuously
    from test_import_cleanrl import saved as saved_agent

    path, task = saved_agent(tmp_path, Continuously()), task_of(VECTOR, MOTORS)
    policy, _ = cleanrl.read(path, fit.Spaces((5,), 3, False))
    spaces = environment_spaces(task)
    as_teacher(policy, None, "guest", task, spaces)
    with pytest.raises(UsageError, match="a file that has the bounds of continuous actions"):
        as_teacher(policy, None, "guest", task, spaces, rescale=True)


CARD = """
summary = "Dream."
[env]
simulator = "gymnasium"
id = "{id}"
[reward]
reward = 1.0
"""


def test_the_command_refuses_in_a_line_rescales_when_asked_and_warns(repaint, home):
    motors, near = Box(-3, 3, (3,)), Box(-1, 1, (5,))
    (home / "dream.toml").write_text(CARD.format(id=noise_env_id(VECTOR, motors)))
    source = model()
    path = saved(home, source)
    words = ["zoo", "add", "guest", path, "--from", "sb3", "--task", "dream.toml"]
    said = repaint(*words)
    assert (said.code, said.out, said.err.count("\n")) == (TeacherMismatch.exit_code, "", 1)
    assert "action 1 of 3 is within [-1, 1], the task's within [-3, 3]" in said.err
    assert not list(home.rglob("*.safetensors"))
    said = repaint(*words, "--rescale-actions")
    assert (said.code, said.err) == (0, "")
    assert "warning" not in said.out

    source.observation_space = near
    source.save(path)
    said = repaint(*words, "--rescale-actions", "--replace")
    assert "warning: observation 1 of 5 was within [-1, 1] in training, is" in said.out
    assert "see whether the score is right" in said.out

    said = repaint("zoo", "add", "other", path, "--rescale-actions")
    assert "expected --from sb3 or cleanrl beside --rescale-actions, found none" in said.err
