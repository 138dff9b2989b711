"""`repaint status`: how far runs are, from their folders alone."""

import json
import os
import subprocess
import sys
import threading
from time import sleep, time

import pytest
from small_runs import files_below
from test_adverse_conditions import PATH
from written_runs import write_run

from repaint_cli.cli import status as command
from repaint_cli.errors import NotFound
from repaint_cli.files.lease import NAME, Lease
from repaint_cli.runs.folder import RunFolder
from repaint_cli.runs.kept_plans import keep_plans
from repaint_cli.runs.newest_rows import ITERATIONS, NewestRows
from repaint_cli.runs.plan import Plan
from repaint_cli.runs.record import RunRecord
from repaint_cli.runs.status import status_of, statuses
from repaint_cli.tasks.card_files import read_task

RETURNS = [[-9.0, -8.0, -7.0, -6.5], [-9.0, -8.0, -6.0, -5.5]]


def run_in(folder, state="running", total=10, **changes):
    """A run of 4 iterations, 1.5 s each, that says it is in a state."""
    run = write_run(folder, RETURNS, settings=[f"ppo.n_iterations={total}"])
    record = run.record.model_copy(update={"state": state, "attempt": 2, "host": "node-7"})
    record.model_copy(update=changes).write(run.files)
    return folder


@pytest.fixture
def gone():
    with subprocess.Popen([sys.executable, "-c", ""]) as child:
        child.wait()
    return child.pid


def test_a_run_s_state_is_that_of_its_process(tmp_path, gone):
    assert status_of(tmp_path / "none", 7).state == "waiting"
    assert status_of(tmp_path / "none", 7).iterations == 7
    folder = run_in(tmp_path / "run")
    assert status_of(folder).state == "killed"  # nobody holds it
    for lease, state in [
        (Lease(pid=os.getpid(), attempt=3), "running"), (Lease(pid=gone), "killed"),
        (Lease(host="elsewhere", pid=1, attempt=3), "running"),
    ]:  # fmt: skip
        lease.write(folder)
        assert status_of(folder).state == state
        assert (status_of(folder).node, status_of(folder).attempt) == (lease.host, lease.attempt)
    os.utime(folder / NAME, (time() - 100, time() - 100))
    assert status_of(folder).state == "killed"  # an iteration takes 1.5 s
    (folder / NAME).unlink()
    for state, failure, told in [
        ("finished", "", "finished"), ("interrupted", "", "stopped"), ("failed", "", "failed"),
        ("interrupted", "reward.py: no", "failed"),
    ]:  # fmt: skip
        record = RunRecord.read(RunFolder(folder))
        record.model_copy(update={"state": state, "failure": failure}).write(RunFolder(folder))
        assert status_of(folder).state == told
    assert (status_of(folder).node, status_of(folder).attempt) == ("node-7", 2)
    (folder / "run.json").write_text("{")
    assert status_of(folder).state == "damaged"


def test_numbers_are_of_the_last_iteration_that_all_seeds_have(tmp_path):
    folder = run_in(tmp_path / "run", total=10)
    Lease(pid=os.getpid()).write(folder)
    row = status_of(folder)
    assert (row.iteration, row.iterations, row.mean_return, row.seconds) == (4, 10, -6.0, 6.0)
    assert 0 < row.seconds_left <= 6 * 1.5
    text = (folder / "metrics.csv").read_text()
    for more in ("5,0,", "5,0," + "0," * 29 + "0\n", "\0\0"):
        (folder / "metrics.csv").write_text(text + more)
        assert status_of(folder).iteration == 4
    for spoiled in ("", "no table", "iteration\nx\n"):
        (folder / "metrics.csv").write_text(spoiled)
        assert status_of(folder).iteration == 0
        assert status_of(folder).seconds_left is None


def test_of_a_long_table_the_end_is_read(tmp_path, monkeypatch):
    n = 400
    write_run(tmp_path / "run", [[float(k) for k in range(n)]] * 3)
    path = tmp_path / "run" / "metrics.csv"
    monkeypatch.setattr("repaint_cli.runs.newest_rows.ROW_BYTES", 160)
    rows = NewestRows.read(path, 3)
    assert (rows.iteration, rows.mean_return, rows.seconds, rows.pace) == (n, n - 1.0, 600.0, 1.5)
    assert path.stat().st_size > 3 * ITERATIONS * 160 * 4


def test_the_table_fits_80_columns_and_counts(repaint, home):
    long = "racer-inner-a-rather-long-name-of-a-variant-0123456789"
    run_in(home / "runs" / "compare" / long, "finished", total=4)
    run_in(home / "runs" / "compare" / "scratch", total=100_000)
    Lease(pid=os.getpid(), host="a-machine-with-a-long-name.example.org").write(
        home / "runs" / "compare" / "scratch"
    )
    before = files_below(home)
    said = repaint("status", "runs")
    assert said.code == 0
    assert max(map(len, said.out.splitlines())) <= 80
    head, *_, last = said.out.splitlines()
    assert head.split() == ["state", "iteration", "return", "left", "node", "try", "run"]
    assert last == "1 running, 1 finished"
    assert "4/100000   -6      " in said.out
    assert "a-machine-" in said.out
    assert files_below(home) == before
    rows = json.loads(repaint("status", "--json").out)
    assert {row["folder"] for row in rows} == {f"runs/compare/{n}" for n in (long, "scratch")}


def test_runs_that_are_only_planned_wait(home):
    card = read_task("reacher").with_settings(["ppo.n_iterations=9"])
    root = home / "runs" / "reacher" / "compare-1"
    keep_plans([Plan(card, "scratch", [n], root / name) for n, name in enumerate("ab")], root)
    run_in(root / "b", "finished", total=4)
    for place in (root, home / "runs", None):
        rows = statuses(place)
        assert [(row.state, row.iterations) for row in rows] == [("waiting", 9), ("finished", 4)]
    with pytest.raises(
        NotFound, match=r"expected runs below .*nowhere/, found none; train: repaint"
    ):
        statuses(home / "nowhere")


def test_it_watches_until_all_have_ended(repaint, home, monkeypatch):
    monkeypatch.setattr(command, "SECONDS", 0.01)
    folder = run_in(home / "run")
    Lease(pid=os.getpid()).write(folder)

    def end():
        sleep(0.3)
        (folder / NAME).unlink()

    thread = threading.Thread(target=end)
    thread.start()
    said = repaint("status", "run", "--watch", "--json")
    thread.join()
    states = [json.loads(line)[0]["state"] for line in said.out.splitlines()]
    assert (states[0], states[-1]) == ("running", "killed")


def test_it_begins_quickly_without_torch(home):
    run_in(home / "run")
    code = (
        "import sys; sys.argv = ['repaint', 'status', 'run']\n"
        "from repaint_cli.cli.app import app\n"
        "app(standalone_mode=False)\n"
        "assert not {'torch', 'numba', 'ray', 'matplotlib'} & sys.modules.keys()"
    )
    env = os.environ | {"PYTHONPATH": PATH}
    done = subprocess.run([sys.executable, "-c", code], env=env, check=False, stdout=-1)
    assert (done.returncode, done.stdout.split()[:1]) == (0, [b"state"])
