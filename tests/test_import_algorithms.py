"""Algorithms of Stable-Baselines3 and sb3-contrib: taken where the policy is PPO's, else named."""

import json
import zipfile

import numpy as np
import pytest
from foreign_policies import ACTIONS, PICTURE, VECTOR, model, task_of
from stable_baselines3 import DDPG, DQN, SAC, TD3, HerReplayBuffer
from stable_baselines3.common.envs import BitFlippingEnv
from test_import_sb3 import WORKS, assert_same_policy, imported, saved, vectors

from repaint_cli.errors import CheckpointError
from repaint_cli.zoo.importers import sb3


def with_settings(path, change):
    """Change the settings in a model's zip file."""
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    data = json.loads(parts["data"])
    change(data)
    parts["data"] = json.dumps(data).encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, part in parts.items():
            archive.writestr(name, part)
    return path


def as_trpo(data):
    """Give PPO's settings the names of sb3-contrib's TRPO, whose policy is of the same class."""
    for name in ("clip_range", "clip_range_vf", "n_epochs"):
        del data[name]
    data |= {
        "ent_coef": 0.0, "vf_coef": 0.0, "max_grad_norm": 0.0, "target_kl": 0.01,
        "cg_max_steps": 15, "cg_damping": 0.1, "line_search_shrinking_factor": 0.8,
        "line_search_max_iter": 10, "n_critic_updates": 10, "sub_sampling_factor": 1,
    }  # fmt: skip


@pytest.mark.parametrize("kind", ACTIONS)
@pytest.mark.parametrize("policy", ["MlpPolicy", "CnnPolicy"])
def test_trpo_is_taken(tmp_path, kind, policy):
    obs, action = PICTURE if policy == "CnnPolicy" else VECTOR, ACTIONS[kind]
    source = model(policy=policy, obs=obs, action=action)
    path = with_settings(saved(tmp_path, source), as_trpo)
    network, card = imported(path, task_of(obs, action))
    pictures = np.random.default_rng(0).integers(0, 256, (50, *PICTURE.shape), dtype=np.uint8)
    seen = pictures if policy == "CnnPolicy" else vectors() / 100
    assert_same_policy(source, network, seen, seen)
    assert card.algorithm == "trpo"


OWN = {"DQN": DQN, "SAC": SAC, "TD3 or DDPG": TD3, "TD3 or DDPG, the other": DDPG}


@pytest.mark.parametrize("name", OWN)
def test_other_algorithms_of_sb3_are_refused_by_name(tmp_path, name):
    env = "CartPole-v1" if name == "DQN" else "Pendulum-v1"
    path = saved(tmp_path, OWN[name]("MlpPolicy", env, buffer_size=10, device="cpu"))
    with pytest.raises(CheckpointError, match=f"found a policy of {name.split(',')[0]}{WORKS}"):
        sb3.read(path)


def test_hindsight_is_named(tmp_path):
    source = DQN(
        "MultiInputPolicy", BitFlippingEnv(4), replay_buffer_class=HerReplayBuffer,
        buffer_size=10, device="cpu",
    )  # fmt: skip
    with pytest.raises(CheckpointError, match=f"found a policy of DQN with HER{WORKS}"):
        sb3.read(saved(tmp_path, source))


CONTRIB = {
    "ars.policies": "ARS",
    "common.maskable.policies": "MaskablePPO",
    "common.recurrent.policies": "RecurrentPPO",
    "crossq.policies": "CrossQ",
    "qrdqn.policies": "QRDQN",
    "tqc.policies": "TQC",
}


@pytest.mark.parametrize("module", CONTRIB)
def test_other_algorithms_of_sb3_contrib_are_refused_by_name(tmp_path, module):
    path = with_settings(
        saved(tmp_path, model()),
        lambda data: data["policy_class"].update(__module__=f"sb3_contrib.{module}"),
    )
    with pytest.raises(CheckpointError, match=f"found a policy of {CONTRIB[module]}{WORKS}"):
        sb3.read(path)


def test_an_unknown_algorithm_with_ppos_policy_is_refused(tmp_path):
    def change(data):
        del data["clip_range"], data["vf_coef"]

    path = with_settings(saved(tmp_path, model()), change)
    with pytest.raises(CheckpointError, match=f"found settings of another algorithm{WORKS}"):
        sb3.read(path)
