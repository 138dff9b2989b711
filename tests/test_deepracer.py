"""DeepRacer's own files as settings of a card."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from repaint_cli.envs.racer.deepracer.model_files import hyperparameters, read_model_metadata
from repaint_cli.errors import CardError
from repaint_cli.tasks.card_files import read_task

REAL = Path(__file__).parents[2] / "shared" / "data" / "deepracer"
TWO = [{"steering_angle": -20, "speed": 1.5}, {"steering_angle": "20", "speed": "0.7", "index": 1}]


def metadata(folder, **data):
    path = folder / "model_metadata.json"
    path.write_text(json.dumps({"action_space": TWO, "sensor": ["FRONT_FACING_CAMERA"]} | data))
    return path


def test_actions_and_sensors_are_the_files(home):
    metadata(home, sensor=["LIDAR", "STEREO_CAMERAS"])
    (home / "mine.toml").write_text(
        'extends = "racer-inner"\n[env]\nmodel_metadata = "model_metadata.json"\nmax_steps = 9\n'
    )
    task = read_task("mine.toml")
    assert task.env.actions == ((-20, 1.5), (20, 0.7))
    assert (task.env.sensors, task.env.max_steps) == ("stereo+lidar", 9)
    env = task.make_env(1)
    assert env.single_action_space.n == 2
    env.reset(seed=[1])
    env.step(np.array([1]))
    params = env.unwrapped.params(0)
    assert (params["speed"], params["steering_angle"]) == (0.7, 20.0)


@pytest.mark.skipif(not REAL.is_dir(), reason="DeepRacer's files are not here")
def test_real_files_are_read(tmp_path):
    fourteen = read_model_metadata(REAL / "model_metadata_drfc1_14actions_v4.json")
    assert (len(fourteen["actions"]), fourteen["sensors"]) == (14, "camera")
    assert fourteen["actions"][1] == [-30.0, 2.0]
    both = metadata(tmp_path, sensor=["FRONT_FACING_CAMERA", "LIDAR"])
    assert read_model_metadata(both)["sensors"] == "camera+lidar"
    ten = read_model_metadata(REAL / "model_metadata_sagemaker_stereo_lidar_10actions.json")
    assert (len(ten["actions"]), ten["sensors"]) == (10, "stereo+lidar")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"action_space": {"speed": {"low": 1, "high": 4}}}, "found a continuous action space"),
        ({"action_space": []}, "expected at least one action"),
        ({"action_space": [{"speed": 1}]}, "to list steering_angle and speed"),
        ({"action_space": None}, "to list steering_angle and speed, found None"),
        ({"sensor": ["LIDAR"]}, "found LIDAR"),
        ({"sensor": [["a"], {}]}, r"found \['a'\], \{\}"),
        ({"sensor": ["SECTOR_LIDAR", "STEREO_CAMERAS"]}, "found SECTOR_LIDAR, STEREO_CAMERAS"),
    ],
)
def test_what_the_racer_has_not_is_refused(home, data, message):
    path = metadata(home, **data)
    with pytest.raises(CardError, match=message):
        read_model_metadata(path)


@pytest.mark.parametrize("text", ["", "[1, 2]", "{", "\x00"])
def test_a_file_that_is_no_object_is_refused(home, text):
    (home / "x.json").write_text(text)
    with pytest.raises(CardError, match=r"x\.json"):
        read_model_metadata(home / "x.json")


def test_a_teacher_of_other_actions_does_not_fit(repaint, home):
    (home / "mine.toml").write_text(
        'extends = "racer-outer"\n[env]\nactions = '
        + json.dumps([[angle, 0.9] for angle in range(-25, 25, 5)])
    )
    said = repaint("transfer", "--teacher", "racer-inner", "--task", "mine.toml")
    assert said.code == 4
    assert "'racer-inner' and task 'mine' choose among other [env] actions" in said.err
    turned = json.dumps(read_task("racer-inner").env.actions[::-1])
    (home / "mine.toml").write_text(f'extends = "racer-outer"\n[env]\nactions = {turned}\n')
    said = repaint("transfer", "--teacher", "racer-inner", "--task", "mine.toml")
    assert "choose among the same [env] actions in another order" in said.err


def test_a_cards_files_lie_beside_it(repaint, home):
    track = Path(__file__).parents[1] / "tasks" / "racer" / "tracks" / "oval.npy"
    (home / "deep").mkdir()
    (home / "deep" / "my-track.npy").write_bytes(track.read_bytes())
    (home / "deep" / "reward_function.py").write_text("def reward_function(params):\n    return 1")
    metadata(home / "deep")
    (home / "deep" / "mine.toml").write_text(
        'extends = "racer-inner"\nsummary = "Mine."\n[env]\ntrack = "my-track.npy"\n'
        'model_metadata = "model_metadata.json"\n[reward]\nfunction = "reward_function.py"\n'
    )
    said = repaint("tasks", "check", "deep/mine.toml")
    assert (said.code, said.err) == (0, "")
    assert re.search(r"2 discrete actions; .*; reward terms of a step: function 1\n", said.out)


THEIRS = {
    "batch_size": "128", "beta_entropy": 0.01, "discount_factor": 0.99, "e_greedy_value": 0.05,
    "epsilon_steps": 10000, "exploration_type": "categorical", "loss_type": "huber", "lr": 1e-4,
    "num_episodes_between_training": 40, "num_epochs": 4, "stack_size": 1,
    "term_cond_avg_score": 100000.0, "term_cond_max_episodes": 100000,
}  # fmt: skip


def card_with(home, hyperparameters, **own):
    (home / "hyperparameters.json").write_text(json.dumps(hyperparameters))
    more = "".join(f"{key} = {value}\n" for key, value in own.items())
    (home / "mine.toml").write_text(
        f'extends = "racer-inner"\n[ppo]\nhyperparameters = "hyperparameters.json"\n{more}'
    )
    return read_task("mine.toml")


def test_hyperparameters_are_ppos_and_the_card_outranks_them(home):
    ppo = card_with(home, THEIRS, n_epochs=5).ppo
    assert (ppo.minibatch_size, ppo.ent_coef, ppo.gamma) == (128, 0.01, 0.99)
    assert (ppo.learning_rate, ppo.n_episodes, ppo.n_epochs) == (1e-4, 40, 5)
    assert ppo.clip_range == read_task("racer-inner").ppo.clip_range


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"learning_rate": 1}, "unknown key 'learning_rate'; DeepRacer's are batch_size, .* lr, "),
        ({"batch_size": "many"}, r"ppo\.minibatch_size: .*found 'many'"),
        ({"lr": -1}, r"ppo\.learning_rate: expected greater than 0"),
        ({"discount_factor": None}, r"ppo\.gamma: expected a valid number"),
    ],
)
def test_wrong_hyperparameters_are_named(home, wrong, message):
    with pytest.raises(CardError, match=message):
        card_with(home, wrong)


def test_a_card_that_counts_steps_keeps_counting_them(home):
    ppo = card_with(home, THEIRS, n_steps=4000, n_envs=2).ppo
    assert (ppo.n_episodes, ppo.n_steps, ppo.minibatch_size) == (None, 4000, 128)
    back = hyperparameters(ppo)
    assert not {"num_episodes_between_training", "term_cond_max_episodes"} & back.keys()
