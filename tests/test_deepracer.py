"""DeepRacer's own files as settings of a card."""

import json
from pathlib import Path

import numpy as np
import pytest

from repaint_cli.cards import read_task
from repaint_cli.deepracer import read_model_metadata
from repaint_cli.errors import CardError

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
    assert (params["speed"], params["steering_angle"]) == (0.7, pytest.approx(20))


@pytest.mark.skipif(not REAL.is_dir(), reason="DeepRacer's files are not here")
def test_real_files_are_read():
    fourteen = read_model_metadata(REAL / "model_metadata_drfc1_14actions_v4.json")
    assert (len(fourteen["actions"]), fourteen["sensors"]) == (14, "camera")
    assert fourteen["actions"][1] == [-30.0, 2.0]
    ten = read_model_metadata(REAL / "model_metadata_sagemaker_stereo_lidar_10actions.json")
    assert (len(ten["actions"]), ten["sensors"]) == (10, "stereo+lidar")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"action_space": {"speed": {"low": 1, "high": 4}}}, "found a continuous action space"),
        ({"action_space": []}, "expected at least one action"),
        ({"action_space": [{"speed": 1}]}, "to list steering_angle and speed"),
        ({"action_space": None}, "to list steering_angle and speed, found None"),
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
    assert "2 discrete actions; reward terms of a random first step: function 1" in said.out
