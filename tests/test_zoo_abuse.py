"""The zoo under load and abuse: many writers, readers meanwhile, no room, odd names, links."""

import subprocess
from contextlib import contextmanager

import killed_runs
import pytest
import torch
from small_runs import QUICK, add_teacher, files_below, weights_of

from repaint_cli.errors import NotFound, StoreError
from repaint_cli.policies.weights import load
from repaint_cli.zoo import store

TRAIN = ["train-teacher", "--task", "reacher", "--name", "mine", *QUICK]


@pytest.fixture
def folder(home):
    return home / "home" / "zoo"


def _add_all(folder, source, iteration, names, start):
    network, card = store.read_teacher(source)
    card = card.model_copy(update={"iteration": iteration})
    start.wait(60)
    for name in names:
        try:
            store.add(network, 0, card.model_copy(update={"name": name}), folder, replace=False)
        except StoreError as error:
            if not str(error).endswith("exists already"):
                raise
        else:
            (folder / f"{name}-is-of-{iteration}").touch()


def test_of_several_who_add_a_name_at_once_one_does(folder, tmp_path):
    source, names = add_teacher(tmp_path), [f"t{i}" for i in range(25)]
    folder.mkdir(parents=True)
    context = killed_runs.process_context()
    start = context.Barrier(4)
    crowd = [
        context.Process(target=_add_all, args=(folder, source, i, names, start)) for i in range(4)
    ]
    for process in crowd:
        process.start()
    for process in crowd:
        process.join(60)
        assert process.exitcode == 0
    for name in names:
        (winner,) = folder.glob(f"{name}-is-of-*")
        _, card = store.read_teacher(folder / f"{name}.safetensors")
        assert str(card.iteration) == winner.name.rpartition("-")[2]
    assert not list(folder.glob(".*"))


def _replace_again_and_again(folder, source, n):
    network, card = store.read_teacher(source)
    for i in range(n):
        store.add(network, 0, card.model_copy(update={"iteration": i}), folder)


def test_who_reads_while_another_writes_meets_a_whole_file(folder, tmp_path):
    source = add_teacher(tmp_path)
    _replace_again_and_again(folder, source, 1)
    context, seen = killed_runs.process_context(), set()
    writer = context.Process(target=_replace_again_and_again, args=(folder, source, 150))
    writer.start()
    while writer.is_alive():
        _, card = store.read_teacher(folder / "old-hand.safetensors")
        seen.add(card.iteration)
    writer.join()
    assert len(seen) > 3
    assert weights_of(folder / "old-hand.safetensors").keys() == weights_of(source).keys()


@contextmanager
def mounted(folder, size):
    """A file system of its own in the memory, where we may have one."""
    folder.mkdir(parents=True, exist_ok=True)
    words = ["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(folder)]
    try:
        done = subprocess.run(words, capture_output=True, timeout=20, check=False)
    except FileNotFoundError:
        pytest.skip("there is no mount here")
    if done.returncode:
        pytest.skip(f"only root may mount a file system: {done.stderr.decode().strip()}")
    try:
        yield
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True, timeout=20)


def remount(folder, options):
    words = ["mount", "-o", f"remount,{options}", str(folder)]
    subprocess.run(words, check=True, timeout=20)


def test_a_full_zoo_keeps_what_it_has(repaint, home, folder):
    with mounted(folder, "100k"):
        add_teacher(folder, "first")
        add_teacher(folder, "second")
        before = files_below(folder)
        said = repaint("zoo", "add", "third", folder / "first.safetensors")
        assert said.code == StoreError.exit_code
        assert said.err.startswith(f"error: cannot write {folder}/third.safetensors: ")
        assert "os error 28" in said.err or "No space left" in said.err
        assert files_below(folder) == before
        remount(folder, "size=200k")
        assert repaint("zoo", "add", "third", folder / "first.safetensors").code == 0


def test_a_disk_that_fills_while_a_teacher_trains(repaint, home):
    with mounted(home / "run", "250k"):
        said = repaint(*TRAIN, "--run", "run/mine", "--iterations", 60)
        assert said.code == StoreError.exit_code
        assert said.err.startswith("error: cannot write run/mine/")
        assert said.err.count("\n") == 1
        command = "repaint train-teacher --resume run/mine"
        assert said.out.splitlines()[-1] == f"next: {command}"
        done = load(home / "run" / "mine" / "checkpoint.safetensors")[1]["iteration"]
        assert 1 <= done < 60
        remount(home / "run", "size=20m")
        assert repaint(*command.split()[1:], "--iterations", done + 2).code == 0
        repaint(*TRAIN, "--name", "calm", "--run", "calm", "--iterations", done + 2)
        tensors = [
            load(path / "checkpoint.safetensors")[0]
            for path in (home / "run" / "mine", home / "calm")
        ]
        assert all(torch.equal(tensors[0][name], tensors[1][name]) for name in tensors[1])


def test_a_store_that_is_only_to_be_read(repaint, home, folder):
    with mounted(folder, "1m"):
        add_teacher(folder)
        remount(folder, "ro")
        assert "old-hand" in repaint("zoo", "list").out
        assert repaint("zoo", "verify", "old-hand").code == 0
        for words in (TRAIN, ["zoo", "add", "new", folder / "old-hand.safetensors"]):
            said = repaint(*words)
            assert said.code == StoreError.exit_code
            assert said.err.startswith("error: cannot write ")
            assert str(folder) in said.err
            assert said.err.endswith(": Read-only file system\n")
        said = repaint("zoo", "remove", "old-hand", "--yes")
        assert said.err.startswith(f"error: cannot remove {folder}/old-hand.safetensors: Read-only")
        assert not (home / "runs").exists()


ODD = ["..", "../up", "a/b", "/etc/passwd", "", ".hidden", "a\nb", "\x1b[2Jx", "a" * 300, "ü", "-x"]


@pytest.mark.parametrize("name", ODD, ids=range(len(ODD)))
def test_names_that_are_no_names(repaint, home, folder, name):
    source = add_teacher(folder)
    before = files_below(home)
    for words in (
        ["zoo", "add", "--", name, source],
        ["train-teacher", "--task", "reacher", f"--name={name}"],
        ["zoo", "remove", "--yes", "--", name],
        ["zoo", "show", "--", name],
        ["transfer", "--task", "reacher", f"--teacher={name}"],
    ):
        if words[0] == "train-teacher" and not name:
            continue  # an empty name is the task's
        said = repaint(*words)
        assert said.code in (NotFound.exit_code, StoreError.exit_code), words
        assert said.err.startswith("error: ")
        assert "\x1b" not in said.err
        assert "\n" not in said.err[:-1]
    assert files_below(home) == before


def test_links_that_lead_out_of_the_zoo_are_not_followed(repaint, home, folder):
    inside, outside = add_teacher(folder), add_teacher(home / "elsewhere", "far")
    (folder / "near.safetensors").symlink_to(inside)
    (folder / "far.safetensors").symlink_to(outside)
    (folder / "loop.safetensors").symlink_to(folder / "loop.safetensors")
    assert {"old-hand", "near"} <= store.teachers().keys()
    assert "far" not in store.teachers()
    said = repaint("zoo", "show", "far")
    assert said.code == NotFound.exit_code
    assert f"is a link that leads out of your zoo, to {outside}; add what is there" in said.err
    assert "loop" not in repaint("zoo", "list").out
    assert (
        repaint("zoo", "add", "far", outside, "--replace").code == 0
    )  # the link goes, not its end
    assert not (folder / "far.safetensors").is_symlink()
    before = outside.read_bytes()
    (folder / "away.safetensors").symlink_to(outside)
    assert repaint("zoo", "remove", "away", "--yes").code == 0
    assert outside.read_bytes() == before


def test_ten_thousand_teachers_are_listed_by_their_headers_alone(repaint, folder, monkeypatch):
    data = add_teacher(folder).read_bytes()
    for i in range(10_000):
        (folder / f"t{i:05}.safetensors").write_bytes(data)

    def opened(*_):
        raise AssertionError("a list opens no file whole")

    monkeypatch.setattr("repaint_cli.files.headers.safe_open", opened)
    lines = repaint("zoo", "list").out.splitlines()
    assert lines[0].split()[:2] == ["teacher", "task"]
    assert sum(line.split()[-1] == "yours" for line in lines) == 10_001
    assert not any("damaged" in line for line in lines)
