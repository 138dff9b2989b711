"""Policies of Stable-Baselines3: read without running anything, and the same as they were there."""

import io
import json
import zipfile

import gymnasium
import numpy as np
import pytest
import torch
from foreign_models import ACTIONS, ALGORITHMS, PICTURE, VECTOR, model, normalised, task_of
from stable_baselines3 import DQN, SAC
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import nn
from torch.testing import assert_close

from repaint_cli import zoo
from repaint_cli.errors import CardError, CheckpointError, TeacherMismatch
from repaint_cli.foreign import sb3
from repaint_cli.foreign.imported import as_teacher
from repaint_cli.foreign.statistics import statistics_of

N = 300
MLPS = {
    "as it comes": {},
    "relu, wide critic": {
        "net_arch": {"pi": [32], "vf": [48, 16]}, "activation_fn": nn.ReLU
    },
    "elu, one list": {"net_arch": [24, 16, 8], "activation_fn": nn.ELU},
    "linear policy": {"net_arch": {"vf": [8]}},
}  # fmt: skip
CNNS = {
    "as it comes": {},
    "narrow": {"features_extractor_kwargs": {"features_dim": 32}},
    "apart": {"share_features_extractor": False, "features_extractor_kwargs": {"features_dim": 48}},
}


def imported(path, task, vecnormalize=None):
    policy, seen = sb3.read(path)
    return as_teacher(policy, statistics_of(path, vecnormalize, seen), "guest", task)


def saved(tmp_path, source):
    path = tmp_path / "model.zip"
    source.save(path)
    return path


def assert_same_policy(source, network, raw, seen):
    """Compare distributions and values at observations: raw for us, as SB3's policy gets them.

    Numbers of single precision that are summed in another order differ by some 1e-7 of the largest
    term: what is compared is off by at most 1e-6 of its own scale.
    """
    with torch.no_grad():
        tensor, _ = source.policy.obs_to_tensor(seen)
        theirs = source.policy.get_distribution(tensor).distribution
        values = source.policy.predict_values(tensor)[:, 0]
        ours = network.policy(torch.from_numpy(raw)[None])
        found = network.value(torch.from_numpy(raw)[None])[0]
    if network.spaces.discrete:
        pairs = [(ours.log_probs[0], theirs.logits)]
    else:
        pairs = [(ours.mean[0], theirs.mean), (ours.log_std[0, 0].exp(), theirs.stddev[0])]
    for mine, other in [*pairs, (found, values)]:
        assert other.std() > 0.1 or other.ndim == 1
        scale = max(1.0, other.abs().max().item())
        assert (mine - other).abs().max() <= 1e-6 * scale


def vectors(n=N, seed=0):
    rng, scales = np.random.default_rng(seed), np.geomspace(0.01, 100, *VECTOR.shape)
    return (3 * scales + scales * rng.normal(size=(n, *VECTOR.shape))).astype(np.float32)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("kind", ACTIONS)
@pytest.mark.parametrize("settings", MLPS.values(), ids=MLPS)
def test_a_dense_policy_is_the_same(tmp_path, algorithm, kind, settings):
    action, obs = ACTIONS[kind], vectors() / 100
    source = model(algorithm, action=action, policy_kwargs=settings)
    network, card = imported(saved(tmp_path, source), task_of(VECTOR, action))
    assert_same_policy(source, network, obs, obs)
    assert (card.algorithm, card.method, card.seed) == (algorithm, "imported", 3)


@pytest.mark.parametrize("kind", ACTIONS)
@pytest.mark.parametrize(
    "settings", [{}, {"clip_obs": 1.5, "epsilon": 0.3}, {"clip_obs": float("inf")}], ids=str
)
def test_normalised_observations_are_seen_the_same(tmp_path, kind, settings):
    action, source = ACTIONS[kind], model(action=ACTIONS[kind])
    normaliser = normalised(source.get_env(), **settings)
    normaliser.save(tmp_path / "vec.pkl")
    path = saved(tmp_path, source)
    network, card = imported(path, task_of(VECTOR, action), str(tmp_path / "vec.pkl"))
    seen = normaliser.normalize_obs(vectors())
    assert seen.std() > 0.5
    assert_same_policy(source, network, vectors(), seen)
    clip = settings.get("clip_obs", 10.0)
    assert card.task.net.obs_clip == ("none" if clip == float("inf") else clip)
    assert network.normalizer.count.item() == pytest.approx(51, abs=0.01)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("kind", ACTIONS)
@pytest.mark.parametrize("settings", CNNS.values(), ids=CNNS)
def test_a_camera_policy_is_the_same(tmp_path, algorithm, kind, settings):
    action = ACTIONS[kind]
    source = model(algorithm, "CnnPolicy", PICTURE, action, policy_kwargs=settings)
    network, card = imported(saved(tmp_path, source), task_of(PICTURE, action))
    obs = np.random.default_rng(0).integers(0, 256, (N, *PICTURE.shape), dtype=np.uint8)
    assert_same_policy(source, network, obs, obs)
    assert card.task.net.kind == "cnn"
    assert (card.task.net.pool, card.obs_shape) == (1, PICTURE.shape)


def test_a_card_says_where_a_teacher_comes_from_and_its_file_comes_back(home):
    source = model(policy_kwargs=MLPS["relu, wide critic"], n_steps=32, batch_size=32)
    source.learn(64)
    network, card = imported(saved(home, source), task_of(VECTOR, ACTIONS["box"]))
    assert (card.env_steps, card.iteration, card.seed) == (64, 0, 3)
    assert card.versions["stable-baselines3"].startswith("2.")
    assert card.score.episodes == 100
    path = zoo.add(network, 0, card, home / "zoo")
    loaded, again = zoo.load_teacher(path)
    assert again == card
    net = again.task.net
    assert (net.activation, net.hidden, net.value_hidden) == ("relu", (32,), (48, 16))
    obs = torch.from_numpy(vectors())[None]
    assert torch.equal(loaded.policy(obs).mean, network.policy(obs).mean)
    assert torch.equal(loaded.value(obs), network.value(obs))


def test_a_model_that_saw_normalised_observations_is_not_read_without_their_statistics(tmp_path):
    source = model(n_steps=16, batch_size=16)
    source.set_env(normalised(source.get_env()))
    source.learn(16)
    path, task = saved(tmp_path, source), task_of(VECTOR, ACTIONS["box"])
    with pytest.raises(CardError, match=r"saw normalised observations.*--vecnormalize none"):
        imported(path, task)
    network, _ = imported(path, task, "none")
    assert_same_policy(source, network, vectors() / 100, vectors() / 100)


class Mine(ActorCriticPolicy):
    """A policy of one's own."""


class Sum(BaseFeaturesExtractor):
    """Reads observations in a way of its own."""

    def __init__(self, space):
        super().__init__(space, space.shape[0])

    def forward(self, obs):
        return obs.cumsum(1)


class Tanh(nn.Module):
    """An activation of one's own by the name of another."""

    def forward(self, x):
        return x


WORKS = "; what can be read: PPO and A2C with MlpPolicy or CnnPolicy"
REFUSED = {
    "gSDE": ({"use_sde": True}, r"with use_sde=True; what can .* without it"),
    "squashed": ({"use_sde": True, "policy_kwargs": {"squash_output": True}}, "squash_output=True"),
    "activation": ({"policy_kwargs": {"activation_fn": nn.GELU}},
                   "expected activation_fn Tanh, ReLU, ELU, found .*GELU"),
    "own activation": ({"policy_kwargs": {"activation_fn": Tanh}}, "found .*Tanh"),
    "own policy": ({"policy": Mine}, "found a policy of .*test_foreign_sb3" + WORKS),
    "own extractor": ({"policy_kwargs": {"features_extractor_class": Sum}},
                      "features_extractor_class=.*Sum"),
    "several actions": ({"action": gymnasium.spaces.MultiDiscrete([2, 3])},
                        r"found .*Box'> \(5,\) and .*MultiDiscrete'> \(2,\)"),
    "from 1": ({"action": gymnasium.spaces.Discrete(3, start=1)}, "actions in a Box or Discrete"),
    "a grid": ({"obs": gymnasium.spaces.Box(0, 1, (3, 4))}, r"found .*Box'> \(3, 4\)"),
    "image without camera": ({"obs": PICTURE}, "found images read without a camera network"),
    "grey levels as they are": (
        {"obs": PICTURE, "policy": "CnnPolicy", "policy_kwargs": {"normalize_images": False}},
        "normalize_images=False"),
    "layers behind the camera": (
        {"obs": PICTURE, "policy": "CnnPolicy", "policy_kwargs": {"net_arch": [8]}},
        r"found dense layers \(net_arch\) behind the camera network"),
}  # fmt: skip


@pytest.mark.parametrize(("settings", "message"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_the_same_is_refused(tmp_path, settings, message):
    path = saved(tmp_path, model(**settings))
    with pytest.raises(CheckpointError, match=message) as refused:
        sb3.read(path)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("kind", "env"), [(DQN, "CartPole-v1"), (SAC, "Pendulum-v1")])
def test_other_algorithms_are_refused(tmp_path, kind, env):
    path = saved(tmp_path, kind("MlpPolicy", env, buffer_size=10, device="cpu"))
    with pytest.raises(CheckpointError, match=f"found a policy of stable_baselines3.*{WORKS}"):
        sb3.read(path)


def test_a_policy_for_other_spaces_is_refused(tmp_path):
    path = saved(tmp_path, model())
    message = (
        "teacher 'guest' has 5 observations and 3 continuous actions, task 'dream' has 5 "
        "observations and 4 discrete actions; give the --task it was trained on"
    )
    with pytest.raises(TeacherMismatch, match=message):
        imported(path, task_of(VECTOR, ACTIONS["discrete"]))


def rewritten(path, **parts):
    """Put other parts into a model's zip; None leaves one out."""
    with zipfile.ZipFile(path) as archive:
        old = {name: archive.read(name) for name in archive.namelist()}
    new = {name.replace("__", "."): part for name, part in parts.items()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, part in (old | new).items():
            if part is not None:
                archive.writestr(name, part)
    return path


def weights(**changes):
    """A policy.pth with some tensors replaced."""
    buffer = io.BytesIO()
    torch.save(model().policy.state_dict() | changes, buffer)
    return buffer.getvalue()


def settings_of(path, **changes):
    with zipfile.ZipFile(path) as archive:
        return json.dumps(json.loads(archive.read("data")) | changes)


class Bomb:
    """What runs a command in whoever unpickles it."""

    def __init__(self, sentinel):
        self.sentinel = sentinel

    def __reduce__(self):
        import os

        return os.system, (f"touch {self.sentinel}",)


def pickled_bomb(sentinel):
    buffer = io.BytesIO()
    torch.save({"log_std": Bomb(sentinel)}, buffer)
    return buffer.getvalue()


DAMAGE = {
    "no zip": (lambda path: path.write_bytes(b"PK, but not really"), "not a whole zip file"),
    "half a zip": (lambda path: path.write_bytes(path.read_bytes()[:1000]), "not a whole zip"),
    "no settings": (lambda path: rewritten(path, data=None), "expected a part 'data', found none"),
    "no weights": (lambda path: rewritten(path, policy__pth=None), "a part 'policy.pth', found no"),
    "elsewhere": (lambda path: rewritten(path, **{"policy__pth": None, "../policy__pth": b"x"}),
                  "expected a part 'policy.pth', found none"),
    "no json": (lambda path: rewritten(path, data=b"{"), "its 'data' is not JSON"),
    "deep json": (lambda path: rewritten(path, data=b"[" * 10**6), "its 'data' is not JSON"),
    "a list": (lambda path: rewritten(path, data=b"[]"), "expected settings in its 'data'"),
    "nothing": (lambda path: rewritten(path, data=b"{}"), "found a policy of None"),
    "no spaces": (lambda path: rewritten(path, data=settings_of(path, action_space=None)),
                  "expected spaces in its 'data', found none"),
    "no kwargs": (lambda path: rewritten(path, data=settings_of(path, policy_kwargs=None)),
                  "expected policy_kwargs"),
    "no torch": (lambda path: rewritten(path, policy__pth=b"x" * 99), "not as torch.save writes"),
    "packed": (lambda path: rewritten(path, policy__pth=path.read_bytes()), "no plain tensors"),
    "a leaf too many": (lambda path: rewritten(path, policy__pth=weights(more=torch.ones(2))),
                        "'more' belongs to no policy that can be read here"),
    "double": (lambda path: rewritten(path, policy__pth=weights(log_std=torch.ones(3).double())),
               r"expected numbers in single precision in 'log_std', found torch.float64"),
    "sparse": (lambda path: rewritten(path, policy__pth=weights(log_std=torch.eye(3).to_sparse())),
               "expected numbers in single precision in 'log_std'"),
    "meta": (lambda path: rewritten(
        path, policy__pth=weights(log_std=torch.ones(10**9, device="meta"))),
        "expected numbers in single precision in 'log_std', found torch.float32 meta"),
    "stride 0": (lambda path: rewritten(
        path, policy__pth=weights(log_std=torch.ones(1).expand(10**12))),
        r"'log_std' claims \(1000000000000,\) numbers that the file does not hold"),
    "nan": (lambda path: rewritten(path, policy__pth=weights(log_std=torch.full((3,), torch.nan))),
            "'log_std' holds numbers that are not finite"),
    "no tensor": (lambda path: rewritten(path, policy__pth=weights(log_std=3)),
                  "in 'log_std', found <class 'int'>"),
}  # fmt: skip


@pytest.mark.parametrize(("damage", "message"), DAMAGE.values(), ids=DAMAGE)
def test_damaged_files_are_refused_in_a_line(tmp_path, damage, message):
    path = saved(tmp_path, model())
    damage(path)
    with pytest.raises(CheckpointError, match=message) as refused:
        sb3.read(path)
    assert "\n" not in str(refused.value)


def test_a_command_hidden_in_the_weights_is_not_run(tmp_path):
    path, sentinel = saved(tmp_path, model()), tmp_path / "ran"
    rewritten(path, policy__pth=pickled_bomb(sentinel))
    with pytest.raises(CheckpointError, match="holds no plain tensors"):
        sb3.read(path)
    assert not sentinel.exists()
    torch.load(io.BytesIO(pickled_bomb(sentinel)), weights_only=False)
    assert sentinel.exists()  # so it would have, elsewhere


def test_a_command_hidden_in_the_settings_is_not_run(tmp_path):
    import base64
    import pickle

    path, sentinel = saved(tmp_path, model()), tmp_path / "ran"
    bomb = base64.b64encode(pickle.dumps(Bomb(sentinel))).decode()
    with zipfile.ZipFile(path) as archive:
        data = json.loads(archive.read("data"))
    for value in data.values():
        if isinstance(value, dict):
            value[":serialized:"] = bomb
    policy, _ = sb3.read(rewritten(path, data=json.dumps(data)))
    assert policy.spaces.n_actions == 3
    assert not sentinel.exists()


def test_a_part_that_would_fill_the_memory_is_not_unpacked(tmp_path, monkeypatch):
    from repaint_cli.foreign import archives

    path = rewritten(saved(tmp_path, model()), policy__pth=bytes(10**7))
    assert path.stat().st_size < 10**5
    monkeypatch.setattr(archives, "LARGEST", 10**6)
    with pytest.raises(
        CheckpointError, match=r"'policy.pth' of at most 1000000 bytes.* 10000000 by"
    ):
        sb3.read(path)
    monkeypatch.setattr(archives, "LARGEST", 10**3)
    with pytest.raises(CheckpointError, match="expected at most 1000 bytes, found"):
        sb3.read(path)


def test_packed_tensors_are_not_unpacked(tmp_path):
    packed = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(weights())) as old,
        zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as new,
    ):
        for name in old.namelist():
            new.writestr(name, old.read(name))
    path = rewritten(saved(tmp_path, model()), policy__pth=packed.getvalue())
    with pytest.raises(CheckpointError, match=r"expected parts as torch.save stores them, found"):
        sb3.read(path)


def test_layers_that_do_not_fit_each_other_are_refused_before_there_is_room_for_them(tmp_path):
    wide = {"mlp_extractor.policy_net.0.bias": torch.zeros(10**6)}
    path = rewritten(saved(tmp_path, model()), policy__pth=weights(**wide))
    message = r"'policy.0.bias' is \(1000000,\)|'policy.0.weight' is \(5, 64\), for 5 observations"
    with pytest.raises(TeacherMismatch, match=message):
        imported(path, task_of(VECTOR, ACTIONS["box"]))


def test_settings_that_are_no_numbers_count_as_unknown(tmp_path):
    path = saved(tmp_path, model())
    changes = {"seed": None, "num_timesteps": -3}
    rewritten(path, data=settings_of(path, **changes), _stable_baselines3_version=b"\xff\n\x1b[31m")
    policy, _ = sb3.read(path)
    assert (policy.seed, policy.env_steps) == (0, 0)
    assert policy.versions == {"stable-baselines3": "unknown"}
    assert_close(policy.leaves["policy.log_std"], model().policy.log_std.detach())
