"""Statistics of normalisers: pickles are read as data, and nothing in any file is run."""

import io
import pickle
import pickletools
import struct
import sys
import zipfile

import gymnasium
import numpy as np
import pytest
from foreign_models import ACTIONS, PICTURE, VECTOR, dreams, normalised
from gymnasium.spaces import Box, Dict, Discrete
from numpy.testing import assert_allclose, assert_array_equal
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

from repaint_cli.errors import CheckpointError
from repaint_cli.foreign import pickles, statistics
from repaint_cli.foreign.statistics import read_statistics

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
        return pickles.read(data)
    finally:
        watching.clear()
        assert happened == []


def dreaming(obs=VECTOR, action=ACTIONS["box"]):
    return DummyVecEnv([lambda: gymnasium.make(dreams(obs, action))])


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


class Calls:
    """Calls a function in whoever unpickles it."""

    def __init__(self, function, *args):
        self.what = function, args

    def __reduce__(self):
        return self.what


class Persistent(pickle.Pickler):
    def persistent_id(self, obj):
        return "somewhere" if obj == "there" else None


def persistent():
    file = io.BytesIO()
    Persistent(file, 4).dump({"there": "there"})
    return file.getvalue()


def malicious(sentinel):
    import os

    command = f"touch {sentinel}"
    code = f"__import__('pathlib').Path({str(sentinel)!r}).touch()"
    laughs = b"".join(b"q" + bytes([n]) + b"0" + 10 * (b"h" + bytes([n])) for n in range(30))
    return {
        "os.system": (pickle.dumps(Calls(os.system, command)), "the name 'posix.system'"),
        "eval": (pickle.dumps(Calls(eval, code), 2), "the name '__builtin__.eval'"),
        "by hand": (b"cos\nsystem\n(S'" + command.encode() + b"'\ntR.", "the name 'os.system'"),
        "inst": (b"(S'" + command.encode() + b"'\nios\nsystem\n.", "the opcode STRING"),
        "obj": (b"(cos\nsystem\no.", "the name 'os.system'"),
        "nested name": (b"\x8c\x05numpy\x8c\x0bdtype.mro()\x93.", "the name 'numpy.dtype.mro()'"),
        "name of no text": (b"K\x01K\x02\x93.", "the name 'a nameless thing'"),
        "persistent id": (persistent(), "the opcode BINPERSID"),
        "extension": (b"\x82\x01.", "the opcode EXT1"),
        "huge bytes": (b"\x8e" + struct.pack("<Q", 2**62) + b"x.", "a broken pickle"),
        "huger bytes": (b"\x8e" + b"\xff" * 8 + b"x.", "a broken pickle"),
        "huge integer": (b"I" + b"9" * 10**6 + b"\n.", "a broken pickle"),
        "more opcodes": (b"N" * (pickles.MOST_OPCODES + 1) + b".", "more than 200000 opcodes"),
        "laughs": (b"(" + laughs + b".", "the opcode POP"),
        "tuple as key": (b"})K\x01s.", "a key that is no text but of type tuple"),
        "empty stack": (b"\x85.", "a broken pickle"),
        "no mark": (b"K\x01t.", "a broken pickle"),
        "no memo": (b"h\x07.", "a broken pickle"),
        "odd items": (b"}(K\x01u.", "an entry of what is no dict"),
        "item of a number": (b"K\x01\x8c\x01aK\x02s.", "an entry of what is no dict"),
        "entry of a number": (b"K\x01K\x02a.", "an entry of what is no list"),
        "state of a number": (b"K\x01}b.", "a state of what is no object"),
        "call of a number": (b"K\x01)R.", "a call of what is no function"),
        "call of a record": (b"cnumpy\ndtype\n)R)R.", "a call of what is no function"),
        "nothing": (b"", "a broken pickle"),
        "garbage": (b"\xff\xfe", "a broken pickle"),
    }


@pytest.mark.parametrize("name", malicious("x"))
def test_malicious_files_do_nothing_and_are_refused_in_a_line(tmp_path, name):
    sentinel = tmp_path / "ran"
    data, found = malicious(sentinel)[name]
    path = tmp_path / "vec.pkl"
    path.write_bytes(data)
    with pytest.raises(pickles.Refused):
        quietly(data)
    assert refusal(path).startswith(f"expected what VecNormalize.save writes, found {found}")
    assert not sentinel.exists()


@pytest.mark.parametrize("name", ["os.system", "eval", "by hand", "inst"])
def test_pythons_own_unpickler_would_have_run_them(tmp_path, name):
    data, _ = malicious(tmp_path / "ran")[name]
    pickle.loads(data)
    assert (tmp_path / "ran").exists()


def test_deep_nesting_and_shared_tuples_cost_nothing(tmp_path):
    deep = b")" + b"\x85" * 150_000 + b"."
    assert isinstance(quietly(deep), tuple)
    doubling = b")" + b"".join(b"q" + bytes([n]) + b"h" + bytes([n]) + b"\x86" for n in range(200))
    assert isinstance(quietly(doubling + b"."), tuple)  # 2²⁰⁰ leaves, were it written out
    path = tmp_path / "vec.pkl"
    path.write_bytes(deep)
    assert "found no VecNormalize" in refusal(path)


def array(shape, data, kind="f8"):
    """A VecNormalize whose mean says it has some shape."""
    dtype = pickles.Record(
        "numpy.dtype", (kind, False, True), (3, "<", None, None, None, -1, -1, 0)
    )
    return pickles.Record("numpy._core.multiarray._reconstruct", (), (1, shape, dtype, False, data))


@pytest.mark.parametrize(
    ("record", "found"),
    [
        (array((10**12,), bytes(8)), "an array of another size than its 8 bytes"),
        (array((0, 10**30), bytes(8)), "an array of another size than its 8 bytes"),
        (array((-1,), bytes(8)), "no array of numbers"),
        (array((True,), bytes(8)), "no array of numbers"),
        (array((1,), "text"), "no array of numbers"),
        (array((1,) * 99, bytes(8)), "no array of numbers"),
        (array((1,), bytes(8), "O8"), "an array of other things than numbers"),
        (array((1,), bytes(8), "f8,f8"), "an array of other things than numbers"),
        (None, "no array of numbers"),
    ],
)
def test_an_array_is_no_larger_than_its_bytes(record, found):
    with pytest.raises(pickles.Refused, match=found):
        pickles.array_of(record)


def test_arrays_of_other_kinds_and_orders_are_read():
    for source in (
        np.arange(6, dtype=">i4").reshape(2, 3),
        np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        np.float32([1.5]),
    ):
        for protocol in (3, 4, 5):
            found = pickles.array_of(pickles.read(pickle.dumps(source, protocol)))
            assert_array_equal(found, source)
            assert found.dtype == source.dtype
    assert pickles.number_of(pickles.read(pickle.dumps(np.float32(0.5)))) == 0.5


def test_a_file_cut_or_changed_anywhere_is_read_or_refused(tmp_path):
    data = pickle.dumps(normalised(dreaming()))
    path = tmp_path / "vec.pkl"
    for cut in range(len(data)):
        path.write_bytes(data[:cut])
        assert "found a broken pickle" in refusal(path)
    rng, read = np.random.default_rng(0), 0
    for _ in range(3000):
        changed = bytearray(data)
        changed[rng.integers(len(data))] = rng.integers(256)
        path.write_bytes(changed)
        try:
            read_statistics(path)
            read += 1
        except CheckpointError:
            continue
    assert 0 < read < 3000


def test_a_file_that_is_too_large_is_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr(statistics, "LARGEST", 100)
    path = saved(tmp_path, normalised(dreaming()))
    assert refusal(path).startswith("expected statistics of at most 100 bytes, found ")


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
    assert sum(1 for _ in pickletools.genops(data)) < pickles.MOST_OPCODES / 100
    assert len(data) < statistics.LARGEST / 100
