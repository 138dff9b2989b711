"""Pickles are read as data: what would run a command in an unpickler does nothing here."""

import io
import os
import pickle
import struct

import numpy as np
import pytest
from foreign_policies import normalised
from numpy.testing import assert_array_equal
from test_import_statistics import dreaming, quietly, refusal

from repaint_cli.errors import CheckpointError
from repaint_cli.zoo.importers import pickles
from repaint_cli.zoo.importers.statistics import read_statistics


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
        "more opcodes": (b"N" * (pickles.MAX_OPCODES + 1) + b".", "more than 200000 opcodes"),
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
            found = pickles.array_of(pickles.parse_pickle(pickle.dumps(source, protocol)))
            assert_array_equal(found, source)
            assert found.dtype == source.dtype
    assert pickles.number_of(pickles.parse_pickle(pickle.dumps(np.float32(0.5)))) == 0.5


def test_a_file_cut_or_changed_anywhere_is_read_or_refused(tmp_path):
    data = pickle.dumps(normalised(dreaming()))
    path = tmp_path / "vec.pkl"
    for cut in range(len(data)):
        path.write_bytes(data[:cut])
        assert "found a broken pickle" in refusal(path)
    rng, read = np.random.default_rng(0), 0
    for _ in range(1000):
        changed = bytearray(data)
        changed[rng.integers(len(data))] = rng.integers(256)
        path.write_bytes(changed)
        try:
            read_statistics(path)
            read += 1
        except CheckpointError:
            continue
    assert 0 < read < 1000
