"""Files are whole or not there."""

import json
import resource
from contextlib import contextmanager

import numpy as np
import pytest
from safetensors.numpy import save_file

from repaint_cli.errors import CheckpointError, StoreError
from repaint_cli.files import atomic
from repaint_cli.files.atomic import atomic_write, sha256, write_text
from repaint_cli.files.headers import read_header


@contextmanager
def full_disk(room):
    """Let no file grow beyond some bytes, which the system reports as a full disk is."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.fixture
def old(tmp_path):
    path = tmp_path / "some.txt"
    path.write_text("old")
    return path


def untouched(old):
    return old.read_text() == "old" and list(old.parent.iterdir()) == [old]


def test_a_file_replaces_another_and_makes_its_folders(old, tmp_path):
    write_text(old, "nεw")
    assert old.read_text(encoding="utf-8") == "nεw"
    write_text(tmp_path / "a" / "b" / "c.txt", "deep")
    assert {path.name for path in tmp_path.rglob("*")} == {"some.txt", "a", "b", "c.txt"}
    assert old.stat().st_mode & 0o777 == 0o644


def test_a_full_disk_leaves_the_old_file_and_nothing_else(old):
    with full_disk(100), pytest.raises(StoreError, match=r"cannot write .*some\.txt: File too la"):
        write_text(old, "new" * 100)
    assert untouched(old)


@pytest.mark.parametrize("function", ["fsync", "replace"])
def test_a_disk_that_fills_up_late_does_too(old, monkeypatch, function):
    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic.os, function, fail)
    with pytest.raises(StoreError, match=r"cannot write .*some\.txt: No space left on device"):
        write_text(old, "new")
    assert untouched(old)


def test_bytes_on_a_full_disk_do_too(old):
    with (
        full_disk(1000),
        pytest.raises(StoreError, match="cannot write"),
        atomic_write(old) as new,
    ):
        new.write_bytes(bytes(10_000))
    assert untouched(old)


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_whatever_else_goes_wrong_is_passed_on(old, error):
    def write_half():
        with atomic_write(old) as new:
            new.write_text("half")
            raise error

    with pytest.raises(error):
        write_half()
    assert untouched(old)


def test_a_file_where_a_folder_should_be_is_named(old):
    with pytest.raises(StoreError, match=r"cannot write .*some\.txt/x: (File exists|Not a dir)"):
        write_text(old / "x", "new")
    assert untouched(old)


def header(path, metadata):
    save_file({"x": np.zeros(3)}, path, metadata=metadata)
    return read_header(path)


def test_a_header_is_read_without_tensors(tmp_path):
    assert header(tmp_path / "x.safetensors", {"repaint": json.dumps({"a": 1})}) == {"a": 1}


@pytest.mark.parametrize("metadata", [None, {"format": "pt"}, {"repaint": "{"}, {"repaint": "1"}])
def test_a_foreign_file_is_told_apart(tmp_path, metadata):
    with pytest.raises(CheckpointError, match="was not written by repaint"):
        header(tmp_path / "x.safetensors", metadata)


def test_an_absent_file_is_named(tmp_path):
    with pytest.raises(CheckpointError, match=r"expected a safetensors file at .*x\.safetensors"):
        read_header(tmp_path / "x.safetensors")


def test_the_hash_is_sha_256s(tmp_path):
    (tmp_path / "abc").write_text("abc")
    assert sha256(tmp_path / "abc").startswith("ba7816bf8f01cfea")
