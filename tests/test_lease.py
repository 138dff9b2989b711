"""A lease on a run: of two processes one writes, also where the file system has no lock."""

import os
import socket
import subprocess
import sys
from pathlib import Path
from time import time
from unittest.mock import Mock

import killed_runs
import pytest
from small_runs import files_below
from test_runs import record_of

from repaint_cli.errors import StoreError
from repaint_cli.files import lease as leases
from repaint_cli.files.atomic import append_text, guarded, write_text
from repaint_cli.files.lease import NAME, Lease, TakenOver, take
from repaint_cli.files.lock import Locked
from repaint_cli.runs import experiment as experiments
from repaint_cli.runs.folder import remove
from repaint_cli.runs.metrics import cut_csv
from repaint_cli.runs.owner import new_run, resumed_run

ELSEWHERE = {"host": "elsewhere", "pid": 1}


@pytest.fixture
def gone():
    """The number of a process that was."""
    with subprocess.Popen([sys.executable, "-c", ""]) as child:
        child.wait()
    return child.pid


def test_a_lease_reads_what_it_writes_and_nothing_else(tmp_path):
    assert Lease.read(tmp_path) is None
    lease = take(tmp_path, "mine", 3)
    assert Lease.read(tmp_path) == lease
    assert (lease.host, lease.pid, lease.attempt) == (socket.gethostname(), os.getpid(), 3)
    lease.check(tmp_path)
    for text in ("", "{}", "[1]", '{"driver": 1, "attempt": "x"}', "\0"):
        (tmp_path / NAME).write_text(text)
        assert Lease.read(tmp_path) is None
        with pytest.raises(TakenOver, match="is written by nobody now"):
            lease.check(tmp_path)


def test_who_lives_is_not_replaced_but_by_its_own_command(tmp_path, gone):
    for holder in (Lease("theirs", pid=os.getppid()), Lease("theirs", **ELSEWHERE)):
        holder.write(tmp_path)
        place = rf"{holder.pid} on {holder.host}\)"
        with pytest.raises(Locked, match=rf"is being written by another process \({place}; wait"):
            take(tmp_path, "mine", 2)
        assert Lease.read(tmp_path) == holder
        assert take(tmp_path, "theirs", 2).attempt == 2
    Lease("theirs", pid=gone).write(tmp_path)
    assert take(tmp_path, "mine", 2).driver == "mine"


def test_equal_numbers_are_not_equal_processes(tmp_path):
    Lease("theirs", host="elsewhere").write(tmp_path)  # of our number
    with pytest.raises(Locked, match="is being written by another process"):
        take(tmp_path, "mine", 2)
    Lease("theirs", pid=os.getppid(), began="an earlier start/1").write(tmp_path)
    lease = take(tmp_path, "mine", 2)
    assert lease.alive(tmp_path)
    assert bool(lease.began) == sys.platform.startswith("linux")


def test_a_disk_that_is_away_for_a_moment_takes_nothing_over(tmp_path, monkeypatch):
    lease = take(tmp_path, "mine", 1)
    with monkeypatch.context() as patch:
        patch.setattr(Path, "read_bytes", Mock(side_effect=OSError(116, "stale")))
        lease.check(tmp_path)
    (tmp_path / NAME).unlink()
    with pytest.raises(TakenOver, match="by nobody now"):
        lease.check(tmp_path)


def test_who_is_silent_elsewhere_counts_as_gone(tmp_path):
    Lease("theirs", **ELSEWHERE).write(tmp_path)
    then = time() - 100
    os.utime(tmp_path / NAME, (then, then))
    with pytest.raises(Locked):
        take(tmp_path, "mine", 2, silent=200)
    assert take(tmp_path, "mine", 2, silent=50).driver == "mine"


def test_a_sign_makes_it_young_and_giving_back_removes_only_one_s_own(tmp_path):
    mine = take(tmp_path, "mine", 1)
    os.utime(tmp_path / NAME, (0, 0))
    mine.renew(tmp_path)
    assert leases._age(tmp_path) < 60
    other = Lease("other")
    other.write(tmp_path)
    os.utime(tmp_path / NAME, (0, 0))
    with pytest.raises(TakenOver):
        mine.renew(tmp_path)
    assert leases._age(tmp_path) > 60
    mine.give_back(tmp_path)
    assert Lease.read(tmp_path) == other
    other.give_back(tmp_path)
    assert not list(tmp_path.iterdir())


def test_every_way_to_write_below_a_folder_is_guarded(tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    table = folder / "metrics.csv"
    table.write_text("iteration,x\n1,0\n2,0\n")

    def refuse():
        raise TakenOver("no")

    before = files_below(tmp_path)
    writes = [
        lambda: write_text(folder / "a" / "new.txt", "x"), lambda: append_text(table, "3,0\n"),
        lambda: cut_csv(table, 1, 1), lambda: remove(table),
    ]  # fmt: skip
    with guarded(folder, refuse):
        for write in writes:
            with pytest.raises(TakenOver):
                write()
        write_text(tmp_path / "beside.txt", "x")
    assert files_below(tmp_path) == before | {"beside.txt": b"x"}
    for write in writes:
        write()


@pytest.mark.parametrize("after", [1, 2])
def test_a_run_that_another_process_took_over_stops_and_writes_nothing(tmp_path, after):
    folder = tmp_path / "run"
    before = {}

    def run_on():
        with new_run(killed_runs.plan("repaint", folder)) as experiment:
            for k, _ in enumerate(experiment.run(), 1):
                assert k <= after
                if k == after:
                    Lease("other", 2).write(folder)
                    before.update(files_below(folder))

    with pytest.raises(TakenOver):
        run_on()
    assert files_below(folder) == before  # not even as interrupted
    with resumed_run(folder, driver="other") as goes_on:
        assert goes_on.learner.iteration == after
        for _ in goes_on.run():
            pass
    record = record_of(folder)
    assert (record["state"], record["attempt"], record["iterations"]) == ("finished", 2, 12)
    assert not (folder / NAME).exists()


def test_without_a_lock_a_second_process_is_refused_and_changes_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr("repaint_cli.files.lock._acquire", lambda _: None)  # as NFS may have it
    folder = tmp_path / "run"
    with new_run(killed_runs.plan("repaint", folder)) as experiment:
        next(experiment.run())
        Lease("other", pid=os.getppid()).write(folder)
        before = files_below(folder)
        with pytest.raises(Locked), resumed_run(folder):
            pass
        assert files_below(folder) == before


def test_run_json_tells_the_iteration_while_it_runs(tmp_path, monkeypatch):
    folder = tmp_path / "run"
    with new_run(killed_runs.plan("repaint", folder)) as experiment:
        for k, _ in enumerate(experiment.run(), 1):
            told = record_of(folder)
            assert told["state"] == "running"
            assert told["iterations"] == (0 if k < 4 else k)  # young enough before
            if k == 3:
                monkeypatch.setattr(experiments, "RECORD_SECONDS", -1.0)
            assert Lease.read(folder).pid == os.getpid()
    assert StoreError in TakenOver.__mro__
