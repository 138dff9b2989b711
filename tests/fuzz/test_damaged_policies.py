"""Damaged and malicious zip files of Stable-Baselines3: refused in a line, none is run."""

import base64
import io
import json
import os
import pickle
import zipfile

import pytest
import torch
from foreign_policies import ACTIONS, VECTOR, model, task_of
from test_import_sb3 import imported, saved
from torch.testing import assert_close

from repaint_cli.errors import CheckpointError, TeacherMismatch
from repaint_cli.zoo.importers import archives, sb3, sb3_settings


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
    "no json": (lambda path: rewritten(path, data=b"{"), "its 'data': Expecting property name"),
    "deep json": (lambda path: rewritten(path, data=b"[" * 10**6), "its 'data': expected at most"),
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
    path = rewritten(saved(tmp_path, model()), policy__pth=bytes(10**7))
    assert path.stat().st_size < 10**5
    monkeypatch.setattr(archives, "MAX_BYTES", 10**6)
    with pytest.raises(
        CheckpointError, match=r"'policy.pth' of at most 1000000 bytes.* 10000000 by"
    ):
        sb3.read(path)
    monkeypatch.setattr(sb3, "MAX_BYTES", 10**3)
    with pytest.raises(CheckpointError, match="expected at most 1,000 bytes, found"):
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


def test_settings_beyond_all_measure_are_not_parsed(tmp_path, monkeypatch):
    path = saved(tmp_path, model())
    monkeypatch.setattr(sb3_settings, "MAX_SETTINGS_BYTES", 100)
    with pytest.raises(CheckpointError, match="expected a 'data' of 100 bytes at most, found"):
        sb3.read(path)
