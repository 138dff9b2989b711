"""DeepRacer's own files as settings of a card."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from repaint_cli.envs.output import Output, output_to
from repaint_cli.envs.racer.deepracer import reward_check
from repaint_cli.envs.racer.deepracer.model_files import hyperparameters, read_model_metadata
from repaint_cli.envs.racer.env import RacerVectorEnv
from repaint_cli.envs.racer.track.files import load_track
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


class Warned(Output):
    def __init__(self):
        super().__init__()
        self.lines = []

    def warns(self, text):
        self.lines.append(text)


def warnings_of(read):
    warned = Warned()
    with output_to(warned):
        read()
    return warned.lines


def test_hyperparameters_that_are_not_read_are_named_with_what_is_done(home):
    (line,) = warnings_of(lambda: card_with(home, THEIRS))
    assert line == (
        "hyperparameters.json: not read: e_greedy_value = 0.05, epsilon_steps = 10000 (actions are "
        "drawn from the policy); loss_type = huber (the critic's loss is the mean squared error); "
        "term_cond_avg_score = 100000.0, term_cond_max_episodes = 100000 (ppo.n_iterations says "
        "when to stop)"
    )
    others = {"stack_size": "2", "exploration_type": "e-greedy", "sac_alpha": 0.2}
    (line,) = warnings_of(lambda: card_with(home, others))
    assert "stack_size = 2 (a policy sees one image)" in line
    assert "exploration_type = e-greedy (actions are drawn from the policy)" in line
    assert "sac_alpha = 0.2 (there is no SAC)" in line
    own = hyperparameters(read_task("racer-inner").ppo)  # which a run of ours writes
    del own["term_cond_max_episodes"]
    assert warnings_of(lambda: card_with(home, own)) == []
    (line,) = warnings_of(lambda: card_with(home, own, n_steps=4000, n_envs=2))
    assert "num_episodes_between_training (ppo.n_steps says how long a rollout is)" in line


NETWORK = "DEEP_CONVOLUTIONAL_NETWORK"


@pytest.mark.parametrize(
    ("data", "conv", "word"),
    [
        ({"neural_network": f"{NETWORK}_SHALLOW"}, None, None),
        ({"neural_network": NETWORK}, "4-layer", None),
        ({"neural_network": NETWORK, "sensor": ["STEREO_CAMERAS"]}, "5-layer", None),
        ({"neural_network": NETWORK}, None, "net.conv, 3-layer; that one is net.conv = '4-layer'"),
        ({"neural_network": "OTHER"}, None, "OTHER (the network is net.conv, 3-layer)"),
        ({"training_algorithm": "sac"}, None, "sac (policies are trained with clipped PPO)"),
        ({"lidar_config": {"num_sectors": 8}}, None, "8} (it has no counterpart)"),
    ],
)
def test_what_model_metadata_says_and_nobody_reads_is_named(home, data, conv, word):
    rest = {"version": "5", "action_space_type": "discrete"}
    metadata(home, **({"training_algorithm": "clipped_ppo"} | rest | data))
    (home / "mine.toml").write_text(
        'extends = "racer-inner"\n[env]\nmodel_metadata = "model_metadata.json"\n'
        + (f"[net]\nconv = '{conv}'\n" if conv else "")
    )
    lines = warnings_of(lambda: read_task("mine.toml"))
    assert len(lines) == (word is not None)
    if word:
        assert lines[0].startswith("model_metadata.json: not read: ")
        assert word in lines[0]


def card_of_actions(home, *pairs):
    (home / "mine.toml").write_text(
        f'extends = "racer-inner"\n[env]\nactions = {json.dumps(pairs)}\nmax_steps = 5\n'
        "[ppo]\nn_iterations = 1\nn_episodes = 1\n[eval]\nepisodes = 1\n"
    )
    return "mine.toml"


def test_an_action_beyond_the_car_is_a_warning_with_what_it_becomes(repaint, home):
    task = card_of_actions(home, (-45, 1), (0, 6), (31, 0.05), (30, 4), (-30, 0.1))
    line = (
        "warning: env.actions: the car steers by at most 30° and drives at 0.1 to 4 m/s: -45° "
        "becomes -30° in action 0, 6 m/s becomes 4 m/s in action 1, 31° becomes 30° and 0.05 m/s "
        "becomes 0.1 m/s in action 2"
    )
    assert line in repaint("tasks", "check", task).out.splitlines()
    said = repaint("train-teacher", "--task", task)
    assert said.out.startswith(line)
    assert "warning: env" not in repaint("tasks", "check", card_of_actions(home, (30, 4))).out


@pytest.mark.parametrize("speed", [0, -1.5])
def test_the_car_drives_forwards(repaint, home, speed):
    said = repaint("tasks", "check", card_of_actions(home, (0, 1), (0, speed)))
    assert said.code == CardError.exit_code
    assert "env.actions: expected speeds above 0 m/s, as the car only drives forwards" in said.err
    assert f"; action 1 has {speed:g} m/s" in said.err
    with pytest.raises(ValueError, match="only drives forwards; action 0 has"):
        RacerVectorEnv(load_track("oval"), 1, actions=[(0, speed)])


def cards_note(repaint, home, env="", reward=""):
    (home / "r.py").write_text("def reward_function(params):\n    return params['speed']\n")
    (home / "mine.toml").write_text(
        f'extends = "racer-inner"\n[env]\ntrack = "oval"\nmax_steps = 5\n{env}\n{reward}'
    )
    said = repaint("tasks", "check", "mine.toml")
    assert said.code == 0
    return [line for line in said.out.splitlines() if "logs of 2026" in line or "today" in line]


FUNCTION = '[reward]\nfunction = "r.py"\n'


def test_todays_car_is_suggested_to_cards_with_deepracers_files(repaint, home, monkeypatch):
    for limit in ("N_STEPS", "LAP_STEPS"):
        monkeypatch.setattr(reward_check, limit, 2)
    metadata(home)
    assert cards_note(repaint, home, reward=FUNCTION) == [
        "note: r.py is for DeepRacer, and the car is sim4, 0.27 m off after a second on logs of "
        '2026; env.car = "sim5" is today\'s, 0.11 m off'
    ]
    both = 'model_metadata = "model_metadata.json"\n'
    (line,) = cards_note(repaint, home, both, FUNCTION)
    assert line.startswith("note: model_metadata.json and r.py are for DeepRacer, and the car is s")
    (line,) = cards_note(repaint, home, f'{both}car = "ideal"')
    assert "model_metadata.json is for DeepRacer, and the car is ideal; env.car" in line
    assert cards_note(repaint, home, f'{both}car = "sim5"', FUNCTION) == []
    assert cards_note(repaint, home) == []


def test_a_task_shows_which_logs_each_car_fits(repaint):
    lines = repaint("tasks", "show", "racer-inner").out.splitlines()
    said = " ".join(lines[lines.index('car = "sim4"') - 3 : lines.index('car = "sim4"')])
    for fact in ("`sim4` fits logs of 2021-22", "on logs of 2026 0.27", "2026 (0.11; on those"):
        assert fact in said.replace("# ", "")
