"""Policies of Stable-Baselines3: read without running anything, and the same as they were there."""

import io
import zipfile

import gymnasium
import numpy as np
import pytest
import torch
from foreign_policies import ACTIONS, ALGORITHMS, PICTURE, VECTOR, model, normalised, task_of
from gymnasium.spaces import Box, Discrete
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from test_import_statistics import seeded
from torch import nn

from repaint_cli.errors import CheckpointError, TeacherMismatch, UsageError
from repaint_cli.learn.evaluation import environment_spaces
from repaint_cli.zoo import store
from repaint_cli.zoo.importers import sb3
from repaint_cli.zoo.importers.imported import as_teacher
from repaint_cli.zoo.importers.statistics import statistics_of

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
    spaces = environment_spaces(task)
    return as_teacher(policy, statistics_of(path, vecnormalize, seen), "guest", task, spaces)


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


def test_a_policy_that_normalises_nothing_says_so_and_older_files_act_alike(tmp_path):
    network, card = imported(saved(tmp_path, model()), task_of(VECTOR, ACTIONS["box"]))
    assert not card.task.net.obs_normalize
    net = {"obs_normalize": True, "obs_clip": "none", "obs_min_std": 0.0}  # as it was said before
    task = card.task.model_copy(update={"net": card.task.net.model_copy(update=net)})
    older = store.add(network, 0, card.model_copy(update={"task": task}), tmp_path / "zoo")
    obs = torch.from_numpy(vectors())[None]
    again, _ = store.read_teacher(older)
    assert again.normalizer.active
    assert torch.equal(again.policy(obs).mean, network.policy(obs).mean)


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
    path = store.add(network, 0, card, home / "zoo")
    loaded, again = store.read_teacher(path)
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
    with pytest.raises(UsageError, match=r"saw normalised observations.*--vecnormalize none"):
        imported(path, task)
    network, _ = imported(path, task, "none")
    assert_same_policy(source, network, vectors() / 100, vectors() / 100)


def test_statistics_are_refused_for_a_model_that_saw_observations_as_they_are(tmp_path):
    source = model(n_steps=16, batch_size=16)
    normalised(source.get_env()).save(tmp_path / "vec.pkl")
    source.learn(16)
    path, task = saved(tmp_path, source), task_of(VECTOR, ACTIONS["box"])
    with pytest.raises(UsageError, match=r"saw observations as they are .* found .*vec\.pkl"):
        imported(path, task, str(tmp_path / "vec.pkl"))
    network, _ = imported(path, task)
    assert_same_policy(source, network, vectors() / 100, vectors() / 100)


def test_the_old_file_of_a_seeded_normaliser_goes_with_its_policy(tmp_path):
    source = model()
    normaliser = normalised(source.get_env())
    seeded(normaliser, "action_space", np.random.RandomState(1))
    normaliser.save(tmp_path / "old.pkl")
    task = task_of(VECTOR, ACTIONS["box"])
    network, _ = imported(saved(tmp_path, source), task, str(tmp_path / "old.pkl"))
    seen = normaliser.normalize_obs(vectors())
    assert_same_policy(source, network, vectors(), seen)
    actions, _ = source.predict(seen, deterministic=True)
    mode = network.policy(torch.from_numpy(vectors())[None]).mode()[0].detach()
    assert np.abs(mode.numpy().clip(-1, 1) - actions).max() <= 1e-5


ALIKE = {
    "numbers in double precision": (
        Box(-np.inf, np.inf, (5,), np.float64), Box(-1, 1, (3,), np.float64), {}),
    "bytes that are no picture": (Box(0, 255, (5,), np.uint8), ACTIONS["box"], {}),
    "a small spread": (VECTOR, ACTIONS["box"], {"policy_kwargs": {"log_std_init": -9.0}}),
    "a wide spread": (VECTOR, ACTIONS["box"], {"policy_kwargs": {"log_std_init": 4.0}}),
    "no scaling of pictures": (VECTOR, Discrete(4), {"policy_kwargs": {"normalize_images": False}}),
}  # fmt: skip


@pytest.mark.parametrize(("obs", "action", "settings"), ALIKE.values(), ids=ALIKE)
def test_other_spaces_and_settings_make_no_difference(tmp_path, obs, action, settings):
    source = model(obs=obs, action=action, **settings)
    network, _ = imported(saved(tmp_path, source), task_of(obs, action))
    seen = np.abs(vectors()).clip(0, 255).astype(obs.dtype) if obs.low[0] == 0 else vectors() / 100
    assert_same_policy(source, network, seen, seen)


@pytest.mark.filterwarnings("ignore:.torch.jit.script_method:DeprecationWarning")
def test_a_compiled_policy_is_the_same(tmp_path):
    source, task, seen = model(), task_of(VECTOR, ACTIONS["box"]), vectors() / 100
    plain, layers = source.policy, source.policy.mlp_extractor
    source.policy = torch.compile(plain)
    network, _ = imported(saved(tmp_path, source), task)
    source.policy = plain
    assert_same_policy(source, network, seen, seen)

    inner = layers.policy_net
    layers.policy_net = torch.compile(inner)
    assert any(".policy_net._orig_mod." in name for name in plain.state_dict())
    network, _ = imported(saved(tmp_path, source), task)
    layers.policy_net = inner  # since to compile it takes half a minute
    assert_same_policy(source, network, seen, seen)


def test_first_layers_that_policy_and_critic_share_in_sb3_1_are_copied(tmp_path):
    source = model(policy_kwargs={"net_arch": {"pi": [16, 8], "vf": [16, 4]}})
    layers = source.policy.mlp_extractor
    layers.value_net[0].load_state_dict(layers.policy_net[0].state_dict())
    path = saved(tmp_path, source)
    old = {}
    for name, tensor in source.policy.state_dict().items():
        name = name.replace("policy_net.0.", "shared_net.0.").replace("_net.2.", "_net.0.")
        if "value_net.0." not in name or tensor.shape[0] == 4:
            old[name] = tensor
    buffer = io.BytesIO()
    torch.save(old, buffer)
    with zipfile.ZipFile(path, "a") as archive:
        parts = {n: archive.read(n) for n in archive.namelist()} | {"policy.pth": buffer.getvalue()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, part in parts.items():
            archive.writestr(name, part)
    network, card = imported(path, task_of(VECTOR, ACTIONS["box"]))
    assert_same_policy(source, network, vectors() / 100, vectors() / 100)
    assert (card.task.net.hidden, card.task.net.value_hidden) == ((16, 8), (16, 4))


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


WORKS = "; what can be read: PPO, A2C and TRPO with MlpPolicy or CnnPolicy"
REFUSED = {
    "gSDE": ({"use_sde": True}, r"with use_sde=True; what can .* without it"),
    "squashed": ({"use_sde": True, "policy_kwargs": {"squash_output": True}}, "squash_output=True"),
    "activation": ({"policy_kwargs": {"activation_fn": nn.GELU}},
                   "expected activation_fn Tanh, ReLU, ELU, found .*GELU"),
    "leaky": ({"policy_kwargs": {"activation_fn": nn.LeakyReLU}}, "found .*LeakyReLU"),
    "own activation": ({"policy_kwargs": {"activation_fn": Tanh}}, "found .*Tanh"),
    "own policy": ({"policy": Mine}, "found a policy of .*test_import_sb3" + WORKS),
    "own extractor": ({"policy_kwargs": {"features_extractor_class": Sum}},
                      "features_extractor_class=.*Sum"),
    "several actions": ({"action": gymnasium.spaces.MultiDiscrete([2, 3])},
                        r"found .*Box'> \(5,\) and .*MultiDiscrete'> \(2,\)"),
    "from 1": ({"action": gymnasium.spaces.Discrete(3, start=1)}, "actions in a Box or Discrete"),
    "bits": ({"action": gymnasium.spaces.MultiBinary(3)}, "and .*MultiBinary'> "),
    "a number seen": ({"obs": gymnasium.spaces.Discrete(5)}, r"found .*Discrete'> \(\) and "),
    "several things seen": (
        {"obs": gymnasium.spaces.Dict(a=VECTOR), "policy": "MultiInputPolicy"},
        r"found .*Dict'> \(\) and "),
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


def test_a_policy_for_other_spaces_is_refused(tmp_path):
    path = saved(tmp_path, model())
    message = (
        "teacher 'guest' has 5 observations and 3 continuous actions, task 'dream' has 5 "
        "observations and 4 discrete actions; give the --task it was trained on"
    )
    with pytest.raises(TeacherMismatch, match=message):
        imported(path, task_of(VECTOR, ACTIONS["discrete"]))
