"""Ray: a worker that is killed in mid-iteration costs nothing; what is not there is said.

With Ray installed the slow tests start a cluster of two workers on this machine.
"""

import importlib.util
import os
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import killed_runs
import pytest
from small_runs import QUICK, add_teacher
from test_adverse_conditions import PATH
from test_resume import bits, table
from test_runs import record_of

from repaint_cli.engines import ray_cluster, ray_node
from repaint_cli.engines.options import RunsWatcher
from repaint_cli.engines.ray_cluster import Cluster
from repaint_cli.engines.ray_node import Job, NodeReport, marker_name
from repaint_cli.engines.ray_probe import Probe
from repaint_cli.errors import EngineError
from repaint_cli.files.atomic import sha256
from repaint_cli.files.lease import Lease
from repaint_cli.files.provenance import versions
from repaint_cli.policies.weights import load
from repaint_cli.runs.newest_rows import NewestRows
from repaint_cli.zoo import sent
from repaint_cli.zoo.view_names import TeacherFile

NEEDS_RAY = pytest.mark.skipif(
    importlib.util.find_spec("ray") is None, reason="needs ray, the extra 'ray'"
)
COMPARE = [
    "compare", "--task", "reacher", "--teacher", "old-hand", "--methods", "scratch,kickstart",
    "--seeds", 2, "--iterations", 60, *QUICK[4:],
    "--set", "eval.episodes=2",
]  # fmt: skip


class Notes(RunsWatcher):
    def __init__(self):
        self.notices = []

    def notice(self, text):
        self.notices.append(text)


@pytest.fixture
def no_ray(monkeypatch):
    """A stand-in for the library, connected to nothing."""
    ray = SimpleNamespace(is_initialized=lambda: False, shutdown=lambda: None)
    monkeypatch.setitem(sys.modules, "ray", ray)
    return ray


@pytest.fixture(autouse=True)
def _settings_stay(monkeypatch):
    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    monkeypatch.delenv("RAY_ADDRESS", raising=False)


def test_ray_that_is_not_installed_is_said(repaint, home, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    add_teacher(home / "home" / "zoo")
    said = repaint(*COMPARE, "--engine", "ray")
    assert (said.code, said.err) == (
        11, "error: --engine ray needs Ray, found none; install it: pip install ray\n"
    )  # fmt: skip
    assert not (home / "runs").exists()


@pytest.mark.parametrize("address", ["127.0.0.1:1", "ray://127.0.0.1:1", "[::1]:1"])
def test_a_cluster_that_does_not_answer_is_said_at_once(no_ray, address):
    before = time.monotonic()
    with pytest.raises(EngineError, match=r"expected a Ray cluster at .*:1, nothing answers there"):
        Cluster(address)
    assert time.monotonic() - before < 2 * ray_cluster.REACH_SECONDS


@pytest.mark.parametrize("address", ["there", "host:port", "a:99999999"])
def test_an_address_that_is_none_is_said(no_ray, address):
    with pytest.raises(EngineError, match=r"expected .*(ray:HOST:PORT|nothing answers)"):
        Cluster(address)


def test_ray_itself_says_why_it_cannot_be_reached(no_ray):
    def init(*_, **__):
        raise ConnectionError("Could not find any running Ray instance.\nmore")

    no_ray.init = init
    with pytest.raises(EngineError, match=r"a Ray cluster at auto: Could not find .* instance\.$"):
        Cluster("auto")


def cluster(*resources, own=False):
    nodes = [
        {"Alive": True, "Resources": one, "NodeID": f"{n}" * 20, "NodeManagerHostname": f"node-{n}"}
        for n, one in enumerate(resources)
    ]
    made = Cluster.__new__(Cluster)
    made.ray, made.own = SimpleNamespace(nodes=lambda: nodes), own
    return made


def test_a_run_that_no_machine_has_room_for_is_said():
    watcher = Notes()
    cluster({"CPU": 2.0}, {"CPU": 8.0, "GPU": 1.0}).check_room(8, 0.5, watcher)
    assert not watcher.notices
    text = "no machine has 4 CPUs and 1 GPUs for a run, found at most 8 CPUs and 0 GPUs"
    cluster({"CPU": 2.0}, {"CPU": 8.0}).check_room(4, 1, watcher)
    assert watcher.notices == [f"{text}; runs wait until one comes"]
    with pytest.raises(EngineError, match="no machine has 3 CPUs for a run, found at most 2 CPUs"):
        cluster({"CPU": 2.0}, own=True).check_room(3, 0, watcher)


def test_a_machine_sees_a_folder_by_its_marker(tmp_path, monkeypatch):
    monkeypatch.setattr(ray_node, "_settle", lambda _: None)
    there, other = tmp_path / "there", tmp_path / "other"
    for folder in (there, other):
        folder.mkdir()
    (there / marker_name("me")).write_text("me")
    (other / marker_name("me")).write_text("somebody else")
    roots = [str(there), str(other), str(tmp_path / "nowhere")]
    report = ray_node.probe("me", "n1", roots)
    assert (report.unseen, report.versions) == (tuple(roots[1:]), versions())
    assert (there / f"{marker_name('me')}-n1").read_text() == "me"
    job = Job(b"", "me", str(other / marker_name("me")), "", {}, {})
    with pytest.raises(EngineError, match=f"does not see {other}, where the runs are to be"):
        ray_node._check_marker(job)


def test_a_folder_that_a_machine_does_not_see_ends_all_before_it_begins(tmp_path, monkeypatch):
    root, watcher = str(tmp_path), Notes()
    probe, sign = Probe(cluster({}), "me", watcher), tmp_path / f"{marker_name('me')}-n1"
    for unseen in ((root,), ()):  # it says so, or leaves no sign that is report here
        sign.touch() if unseen else sign.unlink()
        answers = [("n1", NodeReport("node-1", versions(), unseen))]
        monkeypatch.setattr(Probe, "_answers", lambda *_, answers=answers: answers)
        with pytest.raises(EngineError, match=f"machine node-1 does not see {root}, where the run"):
            Probe(cluster({}), "me", watcher).look([root], {})
    sign.touch()
    other = {**versions(), "torch": "1.0"}
    answers = [("n1", NodeReport("node-1", other, ()))]
    monkeypatch.setattr(Probe, "_answers", lambda *_: answers)
    probe.look([root], {})
    (notice,) = watcher.notices
    assert notice.startswith(f"machine node-1 has torch 1.0 (here {versions()['torch']}): its runs")
    probe.look([root], {})  # asked once
    probe.close()
    assert not list(tmp_path.iterdir())


def test_teachers_travel_by_what_they_hold(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "cache").mkdir()
    fetched = []

    def get(data):
        fetched.append(data)
        return data

    monkeypatch.setitem(sys.modules, "ray", SimpleNamespace(get=get))
    plan = killed_runs.plan("repaint", tmp_path / "run")
    (file,) = plan.teachers
    data, digest = file.path.read_bytes(), sha256(file.path)
    job = Job(b"", "me", "", "", {digest: data}, {str(file.path): digest})
    assert ray_node._with_teachers(plan, job) == plan  # which is here, the very same
    file.path.write_bytes(b"another")
    for _ in range(2):
        moved = ray_node._with_teachers(plan, job)
        assert moved.teachers == (TeacherFile(sent.sent_file(digest), file.view),)
        assert moved.teachers[0].path.read_bytes() == data
    assert fetched == [data]
    sent.sent_file(digest).write_bytes(b"damaged")
    assert ray_node._with_teachers(plan, job).teachers[0].path.read_bytes() == data


def typed(words, **options):
    return subprocess.Popen(
        [sys.executable, "-m", "repaint_cli", *map(str, words)], text=True, stdout=-1, stderr=-1,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([PATH, *filter(None, sys.path)])},
        **options,
    )  # fmt: skip


def trained(root):
    """What runs have written, but for times."""
    return {
        run: (
            table(root / run / "metrics.csv"),
            bits(load(root / run / "checkpoint.safetensors")[0]),
        )
        for run in ("scratch", "kickstart")
    }


@NEEDS_RAY
@pytest.mark.slow
def test_a_worker_killed_in_mid_iteration_changes_no_bit(home, repaint):
    add_teacher(home / "home" / "zoo")
    with typed([*COMPARE, "--engine", "ray:local"]) as driver:
        run = begun(driver, home)
        os.kill(Lease.read(run).pid, signal.SIGKILL)
        _, err = driver.communicate(timeout=300)
    assert driver.returncode == 0, err
    assert "its process on" in err
    assert "was lost" in err
    assert (record_of(run)["attempt"], record_of(run)["state"]) == (2, "finished")
    assert not list(run.parent.glob(".*"))
    calm = repaint(*COMPARE, "--output", "calm.png")
    assert calm.code == 0, calm.err
    (other,) = {path.parent for path in home.glob("runs/*/*/scratch")} - {run.parent}
    assert trained(run.parent) == trained(other)


@NEEDS_RAY
@pytest.mark.slow
def test_an_interruption_ends_the_runs_and_a_command_goes_on(home, repaint):
    add_teacher(home / "home" / "zoo")
    with typed([*COMPARE, "--engine", "ray:local"]) as driver:
        run = begun(driver, home)
        driver.send_signal(signal.SIGTERM)
        _, err = driver.communicate(timeout=120)
    assert driver.returncode == 143, err
    assert record_of(run)["state"] == "interrupted"
    assert not (run / "run.lock").exists()
    said = repaint("compare", "--resume", run.parent.relative_to(home), "--output", "x.png")
    assert said.code == 0, said.err
    assert record_of(run)["attempt"] == 2


def begun(driver, home):
    """The folder of a run that is in its fourth iteration or later."""
    while driver.poll() is None:
        for run in home.glob("runs/reacher/*/scratch"):
            if NewestRows.read(run / "metrics.csv", 2).iteration >= 3:
                return run
        time.sleep(0.05)
    raise AssertionError(driver.stderr.read())
