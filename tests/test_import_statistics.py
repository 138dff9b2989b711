"""Statistics of normalisers: pickles are read as data, and nothing in any file is run."""

import io
import pickle
import pickletools
import sys
import types
import zipfile
from copy import copy

import gymnasium
import numpy as np
import pytest
from foreign_policies import ACTIONS, PICTURE, VECTOR, noise_env_id, normalised
from gymnasium.spaces import Box, Dict, Discrete
from numpy.testing import assert_allclose, assert_array_equal
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

from repaint_cli.errors import CheckpointError
from repaint_cli.zoo.importers import pickles, statistics
from repaint_cli.zoo.importers.statistics import read_statistics

WATCHED = (
    "import",
    "exec",
    "compile",
    "open",
    "os.system",
    "pickle.find_class",
    "subprocess.Popen",
)
happened = []
watching = []
sys.addaudithook(lambda event, args: watching and event in WATCHED and happened.append(event))


def quietly(data):
    """Read a pickle; nothing may be imported, opened, compiled or run meanwhile."""
    happened.clear()
    watching.append(True)
    try:
        return pickles.parse_pickle(data)
    finally:
        watching.clear()
        assert happened == []


def dreaming(obs=VECTOR, action=ACTIONS["box"]):
    return DummyVecEnv([lambda: gymnasium.make(noise_env_id(obs, action))])


def saved(tmp_path, source, protocol=None):
    path = tmp_path / "vec.pkl"
    path.write_bytes(pickle.dumps(source, protocol or pickle.DEFAULT_PROTOCOL))
    return path


@pytest.mark.parametrize("protocol", [3, 4, 5])
@pytest.mark.parametrize("action", ACTIONS.values(), ids=ACTIONS)
@pytest.mark.parametrize("watched", [False, True], ids=["", "monitored"])
def test_what_vecnormalize_saves_is_read(tmp_path, protocol, action, watched):
    venv = dreaming(action=action)
    source = normalised(VecMonitor(venv) if watched else venv, clip_obs=3, epsilon=0.25)
    source.observation_space.seed(1)
    source.action_space.seed(2)
    source.action_space.sample()
    path = saved(tmp_path, source, protocol)
    quietly(path.read_bytes())
    found = read_statistics(path)
    assert_array_equal(found.mean, source.obs_rms.mean)
    assert_array_equal(found.var, source.obs_rms.var + 0.25)
    assert (found.clip, found.count) == (3.0, source.obs_rms.count)


def test_its_own_save_writes_the_same_pickle(tmp_path):
    source = normalised(dreaming())
    source.save(tmp_path / "own.pkl")
    found = read_statistics(tmp_path / "own.pkl")
    assert_array_equal(found.mean, source.obs_rms.mean)


def test_files_of_numpy_1_are_read(tmp_path):
    source = normalised(dreaming())
    text = pickle.dumps(source, 3).replace(b"numpy._core.", b"numpy.core.")
    assert b"numpy.core.multiarray" in text
    (tmp_path / "old.pkl").write_bytes(text)
    assert_array_equal(read_statistics(tmp_path / "old.pkl").var, source.obs_rms.var + 1e-8)


class Reduced:
    """Pickled as what some version of a library wrote."""

    def __init__(self, function, *rest):
        self.what = function, *rest

    def __reduce__(self):
        return self.what


def seeded(normaliser, name, random):
    """Give a normaliser a space of its own, with a generator of random numbers."""
    space = copy(getattr(normaliser, name))
    vars(space)["_np_random"] = random
    setattr(normaliser, name, space)


STATE = np.random.RandomState(1).get_state(legacy=False)
SOURCES_OF_NUMBERS = {
    "RandomState, as now": np.random.RandomState(1),
    "RandomState, numpy 1.17": Reduced(
        getattr(np.random._pickle, "__randomstate_ctor"), ("MT19937",), STATE
    ),
    "RandomState, numpy 1.16": Reduced(
        getattr(np.random, "__RandomState_ctor"), (), np.random.RandomState(1).get_state()
    ),
    "Generator, numpy 1.17": Reduced(
        getattr(np.random._pickle, "__generator_ctor"), ("MT19937",), STATE
    ),
} | {
    name: np.random.Generator(getattr(np.random, name)(1))
    for name in ("MT19937", "PCG64", "PCG64DXSM", "Philox", "SFC64")
}  # fmt: skip


@pytest.mark.parametrize("random", SOURCES_OF_NUMBERS.values(), ids=SOURCES_OF_NUMBERS)
@pytest.mark.parametrize("protocol", [3, 4, 5])
def test_spaces_may_have_been_seeded_in_any_way(tmp_path, random, protocol):
    source = normalised(dreaming())
    for name in ("action_space", "observation_space"):
        seeded(source, name, random)
    path = saved(tmp_path, source, protocol)
    quietly(path.read_bytes())
    assert_array_equal(read_statistics(path).mean, source.obs_rms.mean)


def test_files_of_gym_are_read(tmp_path, monkeypatch):
    source = normalised(dreaming())
    seeded(source, "action_space", np.random.RandomState(1))
    text = pickle.dumps(source, 3).replace(b"numpy._core.", b"numpy.core.")
    text = text.replace(b"gymnasium.spaces", b"gym.spaces")
    assert b"gym.spaces.box" in text
    assert b"gymnasium" not in text
    (tmp_path / "old.pkl").write_bytes(text)
    assert_array_equal(read_statistics(tmp_path / "old.pkl").mean, source.obs_rms.mean)

    seeding = types.ModuleType("gym.utils.seeding")  # as gym 0.22 to 0.25 had it
    seeding.RandomNumberGenerator = type("RandomNumberGenerator", (), {})
    seeding.RandomNumberGenerator._generator_ctor = made = lambda name: None
    made.__module__, made.__qualname__ = seeding.__name__, "RandomNumberGenerator._generator_ctor"
    for name in ("gym", "gym.utils", seeding.__name__):
        monkeypatch.setitem(sys.modules, name, seeding)
    seeded(source, "action_space", Reduced(made, ("PCG64",), {"state": 1}))
    path = saved(tmp_path, source, 4)
    assert b"_generator_ctor" in path.read_bytes()
    assert_array_equal(read_statistics(path).mean, source.obs_rms.mean)


@pytest.mark.parametrize("obs", [VECTOR, PICTURE], ids=["vectors", "images"])
def test_where_only_rewards_are_normalised_observations_are_as_they_are(tmp_path, obs):
    source = normalised(dreaming(obs), norm_obs=False)
    assert read_statistics(saved(tmp_path, source)) is None


class Several(gymnasium.Env):
    """Sees a vector and an image, and tells of a seed, a text and an array."""

    observation_space = Dict(near=VECTOR, far=PICTURE)
    action_space = Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self.observation_space.sample(), {"text": "a", "array": np.ones(2), "true": True}

    def step(self, action):
        return self.observation_space.sample(), 0.0, False, False, {}


def refusal(path):
    with pytest.raises(CheckpointError) as refused:
        read_statistics(path)
    text = str(refused.value)
    assert "\n" not in text
    return text.removeprefix(f"{path}: ")


def test_several_observations_and_images_are_refused_with_a_way_out(tmp_path):
    source = normalised(DummyVecEnv([Several]), norm_obs_keys=["near"])
    text = refusal(saved(tmp_path, source))
    assert text.startswith("expected what VecNormalize.save writes, found statistics of several")
    assert "numpy.savez('stats.npz', mean=v.obs_rms.mean" in text
    images = Box(0, 255, (4, 4, 1), np.uint8)
    text = refusal(saved(tmp_path, normalised(dreaming(images))))
    assert "found a mean of shape (4, 4, 1)" in text


@pytest.mark.parametrize(
    ("change", "found"),
    [
        (lambda v: setattr(v, "clip_obs", 0.0), "numbers that are not finite, or not above 0"),
        (lambda v: setattr(v, "clip_obs", "wide"), "no number"),
        (lambda v: setattr(v, "epsilon", float("nan")), "numbers that are not finite"),
        (lambda v: v.obs_rms.var.__isub__(1e9), "numbers that are not finite, or not above 0"),
        (lambda v: setattr(v.obs_rms, "mean", np.array([None])), "an array of other things than"),
        (lambda v: setattr(v.obs_rms, "mean", np.zeros(4)), r"a mean of shape (4,) and a variance"),
        (lambda v: setattr(v.obs_rms, "mean", [0.0] * 5), "no array of numbers"),
        (lambda v: setattr(v, "obs_rms", None), "no RunningMeanStd"),
        (lambda v: setattr(v, "norm_reward", {1: 2}), "a key that is no text but of type int"),
        (lambda v: setattr(v, "training", print), "the name 'builtins.print'"),
    ],
)
def test_other_contents_are_refused(tmp_path, change, found):
    source = normalised(dreaming())
    change(source)
    assert refusal(saved(tmp_path, source)).startswith(
        f"expected what VecNormalize.save writes, found {found}"
    )


def test_a_pickle_of_another_thing_is_refused(tmp_path):
    assert "found no VecNormalize; give" in refusal(saved(tmp_path, RunningMeanStd(shape=(3,))))
    assert "found no VecNormalize; give" in refusal(saved(tmp_path, [1, 2]))


def test_a_file_that_is_too_large_is_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr(statistics, "MAX_BYTES", 100)
    path = saved(tmp_path, normalised(dreaming()))
    assert f"expected at most 100 bytes, found {path.stat().st_size:,}" in refusal(path)


MEAN, VAR = np.arange(5.0), np.arange(5.0) + 1


def arrays(tmp_path, **parts):
    path = tmp_path / "stats.npz"
    np.savez(path, **parts)
    return path


def test_statistics_in_an_npz_are_read_with_the_usual_settings_or_given_ones(tmp_path):
    usual = read_statistics(arrays(tmp_path, mean=MEAN, var=VAR))
    assert_array_equal(usual.mean, MEAN)
    assert_allclose(usual.var, VAR + 1e-8, rtol=1e-15)
    assert (usual.clip, usual.count) == (10.0, 0.0)
    path = arrays(tmp_path, mean=MEAN, var=VAR, clip_obs=5, epsilon=0.5, count=np.float32([7]))
    given = read_statistics(path)
    assert_array_equal(given.var, VAR + 0.5)
    assert (given.clip, given.count) == (5.0, 7.0)


@pytest.mark.parametrize(
    ("parts", "found"),
    [
        ({"mean": MEAN}, "expected a part 'var.npy', found none"),
        ({"mean": MEAN, "var": VAR[:3]}, "found a mean of shape (5,) and a variance of shape (3,)"),
        ({"mean": MEAN, "var": np.array(["a"] * 5)}, "found an array of <U1"),
        ({"mean": MEAN, "var": VAR, "clip_obs": VAR}, "found 5 numbers where one is wanted"),
        ({"mean": MEAN, "var": np.array([None])}, "found an array of object"),
    ],
)
def test_other_arrays_are_refused(tmp_path, parts, found):
    assert found in refusal(arrays(tmp_path, **parts))


def header(shape):
    file = io.BytesIO()
    said = {"descr": "<f8", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, said)
    return file.getvalue()


@pytest.mark.parametrize(
    ("part", "found"),
    [
        (b"", "a header of another kind"),
        (b"\x93NUMPY\x01\x00\xff\xff", "a header of another kind"),
        (b"\x93NUMPY\x01\x00\x10\x27" + b"(" * 10_000, "a header of another kind"),
        (header((999999999,)) + bytes(8), "an array of another size than its 8 bytes"),
    ],
)
def test_broken_arrays_are_refused(tmp_path, part, found):
    path = tmp_path / "stats.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("mean.npy", part)
        archive.writestr("var.npy", part)
    assert found in refusal(path)


def test_the_limits_leave_room_for_what_vecnormalize_writes():
    data = pickle.dumps(normalised(dreaming()))
    assert sum(1 for _ in pickletools.genops(data)) < pickles.MAX_OPCODES / 100
    assert len(data) < statistics.MAX_BYTES / 100


def test_a_bound_beyond_all_numbers_is_refused(tmp_path):
    source = normalised(dreaming())
    source.clip_obs = 2**2000
    assert "no number" in refusal(saved(tmp_path, source))
