"""What the program must not do: speak to a network, ask a shell, leave its pins unwatched."""

import importlib.util
import json
import re
import subprocess
import sys

import pytest
from small_runs import QUICK, QUICK_LAP, add_teacher

from repaint_cli.files.atomic import UMASK
from repaint_cli.files.paths import PACKAGE
from repaint_cli.runs.metrics import start_csv
from repaint_cli.runs.new_folder import claimed

ROOT = PACKAGE.parent
SILENT = """
import sys
SPEAKS = ("socket.connect", "socket.getaddrinfo", "socket.gethostbyname", "socket.sendto",
          "socket.sendmsg", "urllib.Request", "http.client.connect", "ftplib.connect")
def watch(event, args):
    if event in SPEAKS:
        address = args[-1] if event.startswith("socket.") else args
        if not isinstance(address, (str, bytes)):
            sys.stderr.write(f"SPOKE {event} {args}\\n")
            raise OSError("there is no network here")
    if event == "os.system" or event == "subprocess.Popen" and isinstance(args[1], str):
        sys.stderr.write(f"ASKED A SHELL {event} {args}\\n")
sys.addaudithook(watch)
from repaint_cli.cli.app import main
main()
"""
JOBS = [
    ["train-teacher", "--task", "reacher", "--name", "mine", "--tensorboard", *QUICK],
    ["transfer", "--teacher", "old-hand", "--task", "reacher", "--run", "run", *QUICK],
    ["transfer", "--resume", "run", "--iterations", 3],
    ["eval", "run", "--episodes", 1, "--render-offscreen"],
    ["transfer", "--method", "scratch", "--task", "racer-outer", "--run", "lap", *QUICK_LAP],
    ["eval", "lap", "--episodes", 1, "--render-offscreen"],
    ["similarity", "racer-inner", "racer-outer"],
    ["compare", "--task", "reacher", "--methods", "scratch,kickstart", "--teacher", "old-hand",
     "--jobs", 2, "--iterations", 1, "--seeds", 1,
     "--set", "ppo.n_steps=204", "--set", "ppo.n_envs=4",
     "--set", "eval.episodes=2"],
    ["zoo", "verify", "old-hand"],
    ["zoo", "export", "old-hand", "out", "--onnx"],
]  # fmt: skip


@pytest.mark.slow
def test_the_main_job_speaks_to_no_network_and_asks_no_shell(home):
    add_teacher(home / "home" / "zoo")
    for words in JOBS:
        done = subprocess.run(
            [sys.executable, "-c", SILENT, *map(str, words)],
            capture_output=True, text=True, timeout=300, check=False,
        )  # fmt: skip
        assert "SPOKE" not in done.stderr, done.stderr
        assert "ASKED A SHELL" not in done.stderr, done.stderr
        assert done.returncode in (0, 8), done.stderr  # 8: nothing here draws MuJoCo


def test_who_speaks_is_heard():
    words = [
        "import socket; socket.socket().connect(('192.0.2.1', 80))",
        "import os; os.system('true')",
    ]
    for word, heard in zip(words, ("SPOKE socket.connect", "ASKED A SHELL"), strict=True):
        program = SILENT.partition("from repaint_cli")[0] + word
        done = subprocess.run(
            [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False
        )
        assert heard in done.stderr


SHELLS = re.compile(r"shell\s*=\s*True|os\.(system|popen)|commands\.getoutput|pty\.spawn")


@pytest.mark.parametrize("folder", ["repaint_cli", "tools", "benchmarks"])
def test_no_text_of_a_user_s_reaches_a_shell(folder):
    for path in (ROOT / folder).rglob("*.py"):
        assert not SHELLS.search(path.read_text(encoding="utf-8")), path


@pytest.fixture
def audit():
    spec = importlib.util.spec_from_file_location("audit", ROOT / "tools" / "audit.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def tool(path, text):
    """A stand-in for pip-audit that prints a text."""
    path.write_text(f"#!{sys.executable}\nprint({text!r})\n")
    path.chmod(0o755)
    return str(path)


def test_the_audit_finds_what_is_not_pinned(audit, monkeypatch):
    assert audit.installed("repaint-rl")["pydantic"]
    assert audit.pinned()["mypy-extensions"]
    monkeypatch.setattr(audit, "pinned", lambda: {"torch": "0.1"})
    found = audit.unpinned()
    assert any(
        re.fullmatch(r"torch 2\S+ is installed, constraints.txt says 0.1", one) for one in found
    )
    assert any(one.startswith("pydantic ") and one.endswith("says nothing") for one in found)


def test_the_audit_tells_a_vulnerability_from_silence(audit, tmp_path):
    audited = {"dependencies": [
        {"name": "numpy", "version": "1", "vulns": [{"id": "CVE-1", "fix_versions": ["2"]}]},
        {"name": "rich", "version": "15", "vulns": []},
        {"name": "tzdata", "skip_reason": "not found"},
    ]}  # fmt: skip
    found = audit.vulnerable(tool(tmp_path / "online", json.dumps(audited)))
    assert found[:2] == (["numpy 1: CVE-1, mended in 2"], 2)
    found = audit.vulnerable(tool(tmp_path / "offline", "no connection"))
    assert found == ([], 0, "pip-audit got no answer (exit code 0)")
    found = audit.vulnerable(str(tmp_path / "absent"))
    assert found == ([], 0, "pip-audit did not run (FileNotFoundError)")


def test_every_dependency_has_a_pin():
    text = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    assert text == sorted(text, key=str.lower)
    assert all(re.fullmatch(r"[\w.-]+==[\w.]+", line) for line in text)
    wanted = re.findall(
        r'^    ?"?([A-Za-z][\w-]*)(?:\[\w+\])?>=', (ROOT / "pyproject.toml").read_text(), re.M
    )
    assert wanted
    names = {re.split("==", line)[0].lower().replace("_", "-") for line in text}
    assert {name.lower().replace("_", "-") for name in wanted} <= names


def test_folders_for_what_is_unfinished_are_ours_alone(home):
    modes = []

    def write(files):
        modes.append(files.path.stat().st_mode & 0o777)
        start_csv(files.metrics)

    with claimed(home / "run", write):
        pass
    assert modes == [0o700]
    assert (home / "run").stat().st_mode & 0o777 == 0o777 & ~UMASK
    assert not list(home.glob(".*"))
