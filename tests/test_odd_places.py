"""Odd places and bad moments: one line, the manual's exit code, and the command to go on with."""

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest
from failing_env import card
from small_runs import QUICK, QUICK_LAP, add_teacher

from repaint_cli import errors, process
from repaint_cli.__main__ import main
from repaint_cli.envs.gymnasium.simulator import GymnasiumSimulator
from repaint_cli.errors import RepaintError, StoreError
from repaint_cli.files.paths import PACKAGE
from repaint_cli.zoo.teacher_card import read_card

FIXTURES = Path(__file__).parent / "fixtures"
TRAIN = ["transfer", "--task", "reacher", "--method", "scratch", "--run", "run", *QUICK]


def type_in(words, prefix=(), env=(), **options):
    """Type a command in a process of its own; variables that are None are taken away."""
    paths = os.pathsep.join([str(FIXTURES), str(PACKAGE.parent)])
    whole = os.environ | {"PYTHONPATH": paths, "OMP_NUM_THREADS": "1"} | dict(env)
    return subprocess.run(
        [*prefix, sys.executable, "-m", "repaint_cli", *map(str, words)],
        env={name: value for name, value in whole.items() if value is not None},
        **({"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | options),
        text=True, timeout=300, check=False,
    )  # fmt: skip


def is_a_line(done, code, *texts):
    """Check that a command ended with one line on stderr, and with this exit code."""
    assert done.returncode == code, done.stderr
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    for text in texts:
        assert text in done.stderr


@pytest.mark.parametrize("words", [["--version"], ["zoo", "list"], TRAIN])
def test_standard_output_is_closed(home, words):
    done = type_in(words, stdout=None, preexec_fn=lambda: os.close(1))
    is_a_line(done, StoreError.exit_code, "found it closed; give it a place: repaint … >/dev/null")
    assert not (home / "run").exists()


def test_all_streams_are_closed(home):
    done = type_in(
        ["tasks", "copy", "reacher", "mine.toml"], stdout=None, stderr=None,
        preexec_fn=lambda: os.closerange(0, 3),
    )  # fmt: skip
    assert done.returncode == StoreError.exit_code
    assert not list(home.glob("*.toml"))


@pytest.fixture
def full():
    with open("/dev/full", "w") as disk:
        yield disk


@pytest.mark.parametrize(
    "words", [["--version"], ["--help"], ["tasks", "list"], ["similarity", "reacher", "--json"]]
)
def test_the_disk_of_standard_output_is_full(home, full, words):
    done = type_in(words, stdout=full)
    is_a_line(done, StoreError.exit_code, "cannot write to standard output: No space left")


def test_the_disk_of_a_run_s_log_is_full(home, full):
    done = type_in(TRAIN, stdout=full)
    is_a_line(done, StoreError.exit_code, "; go on with: repaint transfer --resume run\n")
    assert (home / "run" / "checkpoint.safetensors").is_file()


def stranger():
    """The start of a command that runs as a user whom nobody knows; skip where that cannot be."""
    for prefix in (
        ["setpriv", "--reuid=12345", "--regid=12345", "--clear-groups"],
        ["unshare", "--user", "--map-user=12345", "--map-group=12345"],
    ):
        if shutil.which(prefix[0]):
            import_us = [*prefix, sys.executable, "-c", "import repaint_cli"]
            env = os.environ | {"PYTHONPATH": str(PACKAGE.parent)}
            if not subprocess.run(import_us, env=env, capture_output=True).returncode:
                return prefix
    pytest.skip("needs setpriv or unshare, and the right to become another user")


@pytest.fixture
def public(monkeypatch):
    """A folder to be in that everybody may write, wherever pytest's own lies."""
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o777)
        monkeypatch.chdir(folder)
        monkeypatch.setenv("REPAINT_HOME", os.path.join(folder, "home"))
        yield Path(folder)


def test_a_stranger_without_a_home(public):
    homeless = {"HOME": None, "REPAINT_HOME": None, "XDG_DATA_HOME": None, "XDG_CACHE_HOME": None}
    done = type_in(["zoo", "list"], stranger(), homeless)
    is_a_line(done, StoreError.exit_code, "found neither REPAINT_HOME nor a home folder")
    done = type_in(["zoo", "list"], stranger(), homeless | {"REPAINT_HOME": str(public)})
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
def test_a_stranger_whose_home_cannot_be_written(public):
    words = ["transfer", "--task", "racer-inner", "--method", "scratch", *QUICK_LAP]
    nowhere = {"HOME": "/nonexistent", "XDG_CACHE_HOME": None, "TMPDIR": str(public)}
    done = type_in([*TRAIN[:6], "run", *QUICK], stranger(), nowhere)
    assert (done.returncode, done.stderr) == (0, "")
    (cache,) = public.glob("repaint-*")
    assert cache.stat().st_mode & 0o777 == 0o700
    nowhere["TMPDIR"] = "/proc"
    done = type_in(words, stranger(), nowhere)
    assert (done.returncode, done.stderr) == (0, "")
    done = type_in(
        ["train-teacher", "--task", "reacher"], stranger(), nowhere | {"REPAINT_HOME": None}
    )
    is_a_line(done, StoreError.exit_code, "cannot write to /nonexistent")


def test_a_cache_that_others_may_write_is_not_taken(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    assert process.cache_folder("x") == str(tmp_path / "cache" / "repaint" / "x")
    (tmp_path / "cache" / "repaint").chmod(0o777)
    own = process.cache_folder("x")
    assert own == str(tmp_path / f"repaint-{os.geteuid()}" / "x")
    shutil.rmtree(os.path.dirname(own))
    (tmp_path / "elsewhere").mkdir()
    os.symlink(tmp_path / "elsewhere", os.path.dirname(own))
    last = f"/tmp/repaint-{os.geteuid()}/x"
    assert process.cache_folder("x") == last
    monkeypatch.setenv("XDG_CACHE_HOME", "cache")  # a relative one does not count
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert process.cache_folder("x") == last  # no home is made
    (tmp_path / "home").mkdir()
    assert process.cache_folder("x") == str(tmp_path / "home" / ".cache" / "repaint" / "x")


@pytest.fixture
def in_process(home, monkeypatch, capsys):
    """Type a command in this process, which is not changed for it."""
    monkeypatch.setattr("repaint_cli.__main__.prepare", lambda: None)

    def type_words(words):
        monkeypatch.setattr(sys, "argv", ["repaint", *map(str, words)])
        with pytest.raises(SystemExit) as end:
            main()
        return subprocess.CompletedProcess(words, end.value.code, *capsys.readouterr())

    return type_words


@pytest.mark.parametrize(
    "words",
    [
        [*TRAIN[:6], "{}", *QUICK],
        ["transfer", "--resume", "{}"],
        ["eval", "{}"],
        ["zoo", "show", "{}"],
        ["zoo", "export", "reacher", "{}"],
        ["tasks", "copy", "reacher", "{}.toml"],
        ["transfer", "--task", "{}.toml", "--method", "scratch"],
        ["transfer", "--task", "reacher", "--teacher", "{}.safetensors"],
        ["compare", "{}"],
    ],
)
def test_a_name_of_256_letters(in_process, words):
    done = in_process([str(word).format("x" * 256) for word in words])
    assert done.returncode in (2, 5, 7), done.stderr
    is_a_line(done, done.returncode)


def test_too_little_address_space(home):
    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (700_000_000, 700_000_000))

    done = type_in(TRAIN, preexec_fn=limit)
    is_a_line(done, RepaintError.exit_code, "found a limit of 0.70 GB; raise it: ulimit -v")
    assert type_in(["zoo", "list"], preexec_fn=limit).returncode == 0


@pytest.mark.slow
@pytest.mark.parametrize("line", ["text.usetex: True", "backend: module://nowhere", "axes.grid: x"])
def test_plotting_settings_are_ours(home, line):
    folder = home / "config" / "matplotlib"
    folder.mkdir(parents=True)
    for place in (folder, home):
        (place / "matplotlibrc").write_text(f"{line}\n")
    env = {"XDG_CONFIG_HOME": str(home / "config"), "MPLBACKEND": "module://nowhere"}
    done = type_in(TRAIN, env=env)
    assert (done.returncode, done.stderr) == (0, "")
    assert (home / "run" / "curves.png").is_file()


def test_a_caller_who_draws_with_latex_need_not_have_it_for_us(tmp_path):
    import matplotlib

    from repaint_cli.report import style

    with matplotlib.rc_context({"text.usetex": True}):
        figure = style.new_figure(6, 4)
        figure.subplots().set_title("100 %")
        style.headline(figure, "a_b")
        style.save(figure, tmp_path / "x.png")
    assert (tmp_path / "x.png").is_file()


@pytest.mark.parametrize("skip", [2_000_000_000, 0, -1, 1.5, "2"])
def test_a_step_that_would_take_for_ever_is_refused(skip):
    with pytest.raises(ValueError, match="expected a whole frame_skip from 1 to 1,000"):
        GymnasiumSimulator(simulator="gymnasium", id="Reacher-v5", kwargs={"frame_skip": skip})


def test_a_teacher_whose_step_would_take_for_ever_is_refused(home, repaint):
    path = add_teacher(home / "home" / "zoo", settings=["env.kwargs={frame_skip=987}"])
    spoiled = home / "slow.safetensors"
    spoiled.write_bytes(path.read_bytes().replace(b'frame_skip\\": 987', b'frame_skip\\":9999'))
    assert spoiled.read_bytes() != path.read_bytes()
    assert read_card(path).task.env.kwargs == {"frame_skip": 987}
    for words in (["eval", spoiled], ["transfer", "--task", "reacher", "--teacher", spoiled]):
        said = repaint(*words)
        assert said.code == errors.CheckpointError.exit_code
        assert said.err.count("\n") == 1
        assert "expected a whole frame_skip from 1 to 1,000" in said.err


JOBS = ["compare", "--task", "bad.toml", "--methods", "scratch,repaint", "--jobs", 2, "--seeds", 1]

METHODS = ["scratch", "kickstart"]


def worker_of(parent):
    """The process id of the first process that trains for another, once its run has begun."""
    for _ in range(1200):
        tasks = Path(f"/proc/{parent}/task").glob("*/children")  # a thread begins it
        children = " ".join(task.read_text() for task in tasks).split()
        if children and list(Path("runs").glob("*/*/scratch/checkpoint*")):
            return int(children[0])
        time.sleep(0.1)
    raise AssertionError("nothing was begun")


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="needs /proc to find the process")
@pytest.mark.parametrize("retries", [0, 1])
def test_a_worker_killed_for_memory(home, retries):
    add_teacher(home / "home" / "zoo")
    words = ["compare", "--task", "reacher", "--methods", ",".join(METHODS), "--jobs", 2]
    rest = ["--teacher", "old-hand", "--seeds", 1, "--iterations", 60, *QUICK[4:]]
    rest += ["--retries", retries]
    env = os.environ | {"PYTHONPATH": str(PACKAGE.parent), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "repaint_cli", *map(str, words + rest)]
    with subprocess.Popen(command, env=env, text=True, stdout=-1, stderr=-1) as parent:
        os.kill(worker_of(parent.pid), signal.SIGKILL)
        _, err = parent.communicate(timeout=60)
    (root,) = home.glob("runs/reacher/compare-*")
    records = {run: json.loads((root / run / "run.json").read_text()) for run in METHODS}
    if retries:
        assert parent.returncode == 0, err
        assert sorted(record["attempt"] for record in records.values()) == [1, 2]
        assert {record["state"] for record in records.values()} == {"finished"}
    else:
        assert parent.returncode == 1
        assert "was killed (signal 9)" in err
        again = f"go on with: repaint compare --resume {root.relative_to(home)}"
        assert again in err.splitlines()[-1]
        assert sorted(record["iterations"] == 60 for record in records.values()) == [False, True]
    assert not subprocess.run(["pgrep", "-f", str(home)], stdout=-1, check=False).stdout


@pytest.mark.slow
def test_a_worker_s_error_is_the_command_s(home):
    (home / "bad.toml").write_text(card("fails"))
    add_teacher(home / "home" / "zoo")
    done = type_in([*JOBS[:4], "scratch", *JOBS[5:]])
    is_a_line(done, errors.CardError.exit_code, "failed in a step: ValueError: the arm fell off")


@pytest.mark.slow
def test_jobs_without_shared_memory(home):
    hidden = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c"]
    hide = 'mount -t tmpfs -o ro,size=4k none /dev/shm && exec "$@"'
    if not shutil.which("unshare") or subprocess.run([*hidden, hide, "sh", "true"]).returncode:
        pytest.skip("needs unshare, and the right to mount")
    (home / "bad.toml").write_text(card())
    done = type_in([*JOBS[:4], "scratch", *JOBS[5:]], [*hidden, hide, "sh"])
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("error", "code", "text"),
    [
        (ZeroDivisionError("a\nb"), 70, "in repaint, please report it: ZeroDivisionError: a;"),
        (KeyError(), 70, "please report it: KeyError; the traceback: repaint --debug …"),
        (MemoryError(), 1, "not enough memory (no more can be had); raise its limit (ulimit -v)"),
        (RuntimeError("DefaultCPUAllocator: can't allocate memory\nx"), 1, "memory (Def"),
        (ImportError("x.so: failed to map segment from shared object"), 1, "memory (x.so"),
        (OSError(36, "File name too long", "x" * 256), 7, f"'{'x' * 80}': File name too l"),
        (OSError("odd"), 70, "please report it: OSError: odd;"),
    ],
)  # fmt: skip
def test_what_nobody_foresaw_is_a_line(in_process, monkeypatch, error, code, text):
    def fail():
        raise error

    monkeypatch.setattr("repaint_cli.cli.app.main", fail)
    is_a_line(in_process(["zoo", "list"]), code, text)
    monkeypatch.setattr(sys, "argv", ["repaint", "--debug", "zoo", "list"])
    with pytest.raises(type(error)):
        main()
