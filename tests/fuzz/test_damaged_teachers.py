"""Teachers from elsewhere: headers that lie, cards beyond reason, code that is not run."""

import json
import os
import sys

import numpy as np
import pytest
from read_damaged_files import Reading
from small_runs import REACHER, add_teacher

from repaint_cli.errors import CheckpointError
from repaint_cli.files.headers import HASH, KEY
from repaint_cli.files.limits import MAX_BYTES
from repaint_cli.policies import weights
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.runs import checkpoint
from repaint_cli.tasks.card_files import read_task
from repaint_cli.zoo import store
from repaint_cli.zoo.teacher_card import read_card


@pytest.fixture
def teacher(tmp_path):
    return add_teacher(tmp_path / "zoo")


def with_header(path, change):
    """Write another header over a safetensors file's own."""
    data = path.read_bytes()
    length = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + length])
    text = change(header) or header
    text = text if isinstance(text, bytes) else json.dumps(text).encode()
    path.write_bytes(len(text).to_bytes(8, "little") + text + data[8 + length :])


def with_card(path, change):
    def in_header(header):
        card = json.loads(header["__metadata__"][KEY])
        card.pop(HASH, None)  # which would refuse it first
        text = change(card) or json.dumps(card)
        header["__metadata__"][KEY] = text

    with_header(path, in_header)


def no_teacher(path, message):
    with pytest.raises(CheckpointError, match=message) as caught:
        store.read_teacher(path)
    assert len(str(caught.value)) < 1000


LENGTHS = [2**63, 2**64 - 1, 2**40, 2**31, MAX_BYTES + 1, 0, 1]


@pytest.mark.parametrize("length", LENGTHS)
def test_a_header_of_another_length_is_refused(teacher, length):
    data = teacher.read_bytes()
    teacher.write_bytes(length.to_bytes(8, "little") + data[8:])
    no_teacher(teacher, "is not a whole safetensors file")


HEADERS = {
    "overlap": lambda h: h["policy.0.bias"].update(
        data_offsets=h["policy.0.weight"]["data_offsets"]
    ),
    "backwards": lambda h: h["policy.0.bias"].update(data_offsets=[256, 0]),
    "beyond": lambda h: h["policy.0.bias"].update(data_offsets=[0, 2**62]),
    "negative": lambda h: h["policy.0.bias"].update(data_offsets=[-1, 255]),
    "huge": lambda h: h["policy.0.weight"].update(shape=[10**9, 10**9]),
    "overflowing": lambda h: h["policy.0.weight"].update(shape=[2**63, 2**63]),
    "no offsets": lambda h: h["policy.0.bias"].pop("data_offsets"),
    "unknown type": lambda h: h["policy.0.bias"].update(dtype="F31"),
    "not UTF-8": lambda h: b"{" + b"\xff" * 40 + b"}",
    "nested": lambda h: b'{"a":' * 100_000,
    "no object": lambda h: b"[]",
}  # fmt: skip


@pytest.mark.parametrize("case", HEADERS)
def test_a_header_that_lies_is_refused(teacher, case):
    with_header(teacher, HEADERS[case])
    no_teacher(teacher, "is not a whole safetensors file")


OTHER_LEAVES = {
    "type": (
        lambda h: h["policy.0.bias"].update(dtype="I32"),
        r"leaf 'policy.0.bias' is \(64,\) int32 in the file, \(64,\) float32 in the network",
    ),
    "half type": (
        lambda h: h["policy.0.bias"].update(dtype="BF16", shape=[128]),
        r"is \(128,\) BF16 in the file",
    ),
    "eighth type": (
        lambda h: h["policy.0.bias"].update(dtype="F8_E4M3", shape=[256]), "F8_E4M3 in the file",
    ),
    "another shape": (
        lambda h: h["policy.0.bias"].update(shape=[8, 8]),
        r"is \(8, 8\) float32 in the file, \(1, 64\) float32",
    ),
    "missing": (lambda h: h.update({"x": h.pop("policy.0.bias")}), "'policy.0.bias' is missing"),
    "empty": (
        lambda h: h.update({"x": {"dtype": "F32", "shape": [0], "data_offsets": [0, 0]}}),
        "leaf 'x' is unknown to the network",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", OTHER_LEAVES)
def test_leaves_are_compared_before_they_are_read(teacher, case, monkeypatch):
    change, message = OTHER_LEAVES[case]
    with_header(teacher, change)
    monkeypatch.setattr(weights, "load", None)
    no_teacher(teacher, message)


WIDE = {
    "obs": (lambda c: c.update(obs_shape=[10**9]), r"weight' is \(10, 64\) .*\(1000000000, 64\)"),
    "hidden": (
        lambda c: c["task"]["net"].update(hidden=[10**9]),
        r"weight' is \(10, 64\) .*\(10, 1000000000"
    ),
    "deep": (
        lambda c: c["task"]["net"].update(hidden=[64] * 50_000), "leaf 'policy.2.weight' is missing"
    ),
    "actions": (lambda c: c.update(n_actions=10**9), r"is \(64, 2\) float32 in the file, \(64, 10"),
}  # fmt: skip


@pytest.mark.parametrize("case", WIDE)
def test_a_card_of_a_huge_network_allocates_none(teacher, case, monkeypatch):
    change, message = WIDE[case]
    with_card(teacher, change)
    monkeypatch.setattr(ActorCritic, "__init__", None)
    no_teacher(teacher, message)


def test_a_huge_network_of_nothing_is_not_read_in(tmp_path, monkeypatch):
    path = tmp_path / "x.safetensors"
    task = read_task("reacher").with_settings(["net.hidden=[20000,20000]"])
    header, size = {}, 0
    for name, (shape, kind) in weights.forms_of(REACHER, task.net).items():
        end = size + int(np.prod(shape)) * (4 if kind == "float32" else 8)
        dtype = "F32" if kind == "float32" else "F64"
        header[name] = {"dtype": dtype, "shape": shape, "data_offsets": [size, end]}
        size = end
    text = json.dumps(header).encode()
    path.write_bytes(len(text).to_bytes(8, "little") + text)
    os.truncate(path, 8 + len(text) + size)  # 3 GB of a hole
    with pytest.raises(CheckpointError, match="at most 268,435,456 numbers, found 800,"):
        weights.check_networks(path, REACHER, task.net, 1, "it")


def test_a_larger_header_is_not_parsed(tmp_path):
    text = json.dumps({"__metadata__": {KEY: "x" * MAX_BYTES}}).encode()
    path = tmp_path / "x.safetensors"
    path.write_bytes(len(text).to_bytes(8, "little") + text)
    no_teacher(path, "a header of more than 8,388,608 bytes")


@pytest.mark.parametrize("what", ["leaves", "text"])
def test_the_largest_header_takes_its_share_of_memory(tmp_path, what):
    leaf = {"dtype": "F32", "shape": [0], "data_offsets": [0, 0]}
    if what == "leaves":
        header = {f"{n:06}": leaf for n in range(MAX_BYTES // 80)}
    else:
        header = {"__metadata__": {KEY: json.dumps("\U0001f600" * (MAX_BYTES // 15))}}
    text = json.dumps(header).encode()
    assert MAX_BYTES * 0.8 < len(text) <= MAX_BYTES
    data = len(text).to_bytes(8, "little") + text
    path = tmp_path / "x.safetensors"
    path.write_bytes(data)
    reading = Reading()
    with reading.watched(what, data), pytest.raises(CheckpointError, match="was not written by"):
        store.read_teacher(path)
    with (
        reading.watched(what, data),
        pytest.raises(CheckpointError, match="is missing in the file"),
    ):
        weights.check_networks(path, REACHER, read_task("reacher").net, 1, "it")
    assert reading.failures == []


CARDS = {
    "nested": (lambda c: "[" * 100_000, "expected at most 32 levels, found more"),
    "nested objects": (lambda c: '{"a":' * 90_000, "expected at most 32 levels"),
    "levels": (lambda c: "[" * 33 + "]" * 33, "expected at most 32 levels"),
    "digits": (lambda c: '{"seed": ' + "9" * 10_000 + "}", "4300 digits"),
    "bits": (lambda c: c.update(seed=2**65), "numbers of at most 64 bits"),
    "many": (lambda c: c.update(parents=["x"] * 200_000), "expected at most 100,000 values"),
    "many wrong": (lambda c: c.update(parents=[1] * 90_000), "90,000 of its values are not what"),
    "infinity": (lambda c: c["task"]["ppo"].update(gamma=np.inf), "ppo.gamma: .*, found inf"),
    "1e999": (lambda c: json.dumps(c).replace('"gamma": 0.99', '"gamma": 1e999'), "found inf"),
    "NaN": (lambda c: c["task"]["reward"].update(reward_dist=np.nan), "finite number, found nan"),
    "surrogate": (lambda c: c.update(created="\ud800"), "surrogates not allowed"),
    "BOM": (lambda c: "\ufeff" + json.dumps(c), "Unexpected UTF-8 BOM"),
    "lone BOM": (lambda c: "\ufeff", "Unexpected UTF-8 BOM"),
    "another name": (lambda c: c.update(name="../../x"), "name: expected 1 to 64 letters"),
    "another folder": (lambda c: c["task"].update(name="../x"), "expected a name that a folder"),
    "escape": (lambda c: c["task"].update(name="\x1b[2J"), "expected a name that a folder"),
    "no vector": (lambda c: c.update(obs_shape=[2, 2]), "the size of a vector, or the three of"),
    "nothing": (lambda c: c.update(obs_shape=[0]), "obs_shape.0: .*greater than 0"),
    "no actions": (lambda c: c.update(n_actions=-1), "n_actions: .*greater than 0"),
    "a long key": (lambda c: c.update({"x" * 10_000: 1}), "unknown key 'x{200}'"),
}  # fmt: skip


@pytest.mark.parametrize("case", CARDS)
def test_a_card_beyond_reason_is_refused(teacher, case):
    change, message = CARDS[case]
    with_card(teacher, change)
    no_teacher(teacher, message)


def test_keys_that_come_twice_are_taken_once(teacher):
    with_card(teacher, lambda card: '{"seed": 99, ' + json.dumps(card)[1:])
    assert read_card(teacher).seed == 0


def test_statistics_that_cannot_be_are_refused(teacher):
    tensors, card = weights.load(teacher)
    tensors["normalizer.var"][0] = -1
    weights.save(teacher, tensors, card)
    no_teacher(teacher, "leaf 'normalizer.var' holds numbers below 0")


def test_an_image_for_a_vectors_network_is_one_bad_teacher_among_others(repaint, home):
    folder = home / "home" / "zoo"
    with_card(add_teacher(folder, "a"), lambda card: card.update(obs_shape=[4, 4, 1]))
    add_teacher(folder, "b")
    said = repaint("zoo", "verify")
    assert said.code == 5
    assert "a: net.kind 'mlp' reads a vector, the task gives 4×4×1" in said.err
    assert "b: sound" in said.out


def test_a_run_of_a_huge_network_allocates_none(tmp_path):
    path = add_teacher(tmp_path)
    task = read_task("reacher").with_settings(["net.hidden=[1000000000]"])
    with pytest.raises(CheckpointError, match=r"\(10, 64\) float32 in the file, \(10, 10000000"):
        weights.check_networks(path, REACHER, task.net, 1, str(path))
    with pytest.raises(CheckpointError, match="is missing in the file"):
        weights.check_networks(path, REACHER, task.net, 1, str(path), checkpoint.NETWORKS)


def test_a_teachers_card_imports_no_module(repaint, home):
    (home / "evil_module.py").write_text("open('ran', 'w').close()")
    sys.path.insert(0, str(home))
    path = add_teacher(home)
    with_card(path, lambda card: card["task"]["env"].update(id="evil_module:Reacher-v5"))
    said = repaint("eval", path)
    sys.path.remove(str(home))
    assert said.code == 3
    assert "the module of evil_module:Reacher-v5, which is never run from a teacher's" in said.err
    assert not (home / "ran").exists()
    assert "evil_module" not in sys.modules
