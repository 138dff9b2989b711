"""What is installed: code and data, from any folder, by the line that the README shows."""

import os
import re
import shlex
import shutil
import subprocess
import sysconfig
import venv
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest

ROOT = Path(__file__).parents[1]
OFFLINE = {"PIP_NO_INDEX": "1", "PIP_NO_BUILD_ISOLATION": "0", "PIP_DISABLE_PIP_VERSION_CHECK": "1"}
"""For pip: nothing comes from an index, and hatchling is the one installed here (0 means so)."""

LOOK = """
from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.files import paths
from repaint_cli.report.html import FOLDER
from repaint_cli.files.paths import shipped_tasks
from repaint_cli.zoo.store import teachers
assert "site-packages" in str(paths.PACKAGE), paths.PACKAGE
assert {"page.html", "page.css", "page.js"} <= {path.name for path in FOLDER.iterdir()}
print(paths.PACKAGE)
print(*shipped_tasks())
print(*teachers())
print(load_track("oval").name)
"""

COMMANDS = (
    "repaint similarity reacher-gentle reacher",
    "repaint train-teacher --task reacher --iterations 1 --name mine",
    "repaint transfer --teacher mine --task reacher --iterations 2",
    "repaint eval",
    "repaint transfer --teacher racer-inner --task racer-outer --iterations 1 --eval-episodes 2",
)

pytestmark = pytest.mark.slow


class Installed:
    """A new virtual environment with what the README's line for pip installs, and a home."""

    def __init__(self, folder):
        self.folder = folder
        venv.create(folder / "env", with_pip=True)
        self.bin = folder / "env" / "bin"
        (site,) = (folder / "env").glob("lib/*/site-packages")
        # Libraries are those of the tests; what is editable there is not found by that.
        (site / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n")
        self.site = site
        (folder / "home").mkdir()
        self.environment = {
            key: value for key, value in os.environ.items()
            if not key.startswith(("PYTHON", "REPAINT", "PIP_"))
        } | OFFLINE | {
            "PATH": f"{self.bin}{os.pathsep}{os.environ['PATH']}",
            "HOME": str(folder / "home"), "XDG_DATA_HOME": "", "XDG_CACHE_HOME": "",
            "no_proxy": "127.0.0.1",
        }  # fmt: skip

    def run(self, call):
        """Run a command in the folder; return what it printed."""
        done = subprocess.run(
            shlex.split(call), cwd=self.folder, env=self.environment, capture_output=True, text=True
        )
        assert done.returncode == 0, f"{call}: {done.stdout[-2000:]} {done.stderr[-2000:]}"
        return done.stdout


class Silent(SimpleHTTPRequestHandler):
    """Serves files, and logs nothing."""

    def log_message(self, *words):
        pass


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """The address of a copy of this repository, as it is, committed or not."""
    repository = tmp_path_factory.mktemp("address") / "repaint"
    ignored = shutil.ignore_patterns(".git", ".venv*", ".*_cache")  # and what git ignores
    shutil.copytree(ROOT, repository, ignore=ignored)
    git = ["git", "-C", str(repository), "-c", "user.name=t", "-c", "user.email=t@example.org"]
    for words in ("init -q", "add -A", "commit -q -m all", "update-server-info"):
        subprocess.run([*git, *words.split()], check=True, capture_output=True)
    serve = partial(Silent, directory=str(repository.parent))
    with ThreadingHTTPServer(("127.0.0.1", 0), serve) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/repaint/.git"
        server.shutdown()


@pytest.fixture(scope="module")
def installed(tmp_path_factory, address):
    """What the README's line installs in a new environment."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (line,) = re.findall(r"^pip install .*$", readme, re.MULTILINE)
    here = Installed(tmp_path_factory.mktemp("elsewhere"))
    here.run("python -m pip uninstall --yes setuptools")  # which is older than the tests' own
    here.run(f"python -m {line.replace('ADDRESS', address)}")
    return here


def test_the_wheel_brings_tasks_tracks_and_zoo_and_no_code_among_them(installed):
    names = {path.name for path in installed.site.iterdir()}
    brought = {
        name
        for name in names
        if "repaint" in name or name in ("tasks", "zoo", "experiments", "tests")
    }
    assert {name.partition("-")[0] for name in brought} == {"repaint_cli", "repaint_rl"}
    data = installed.site / "repaint_cli" / "_data"
    assert not list(data.rglob("*.py"))
    for kind in ("tasks", "zoo", "experiments"):
        beside = {path.relative_to(ROOT / kind) for path in (ROOT / kind).rglob("*.*")}
        assert {path.relative_to(data / kind) for path in (data / kind).rglob("*.*")} == beside

    said = installed.run(shlex.join(["python", "-P", "-c", LOOK]))
    package, tasks, teachers, track = said.splitlines()
    assert Path(package) == installed.site / "repaint_cli"
    assert set(tasks.split()) == {path.stem for path in (ROOT / "tasks").rglob("*.toml")}
    assert set(teachers.split()) == {path.stem for path in (ROOT / "zoo").glob("*.safetensors")}
    assert track == "oval"


def test_the_commands_run_outside_the_checkout(installed):
    said = [installed.run(call) for call in COMMANDS]
    assert "0.894" in said[0]
    assert "return" in said[3]
    assert list((installed.folder / "runs").glob("*/*/run.json"))
    zoo = installed.folder / "home" / ".local" / "share" / "repaint" / "zoo"
    assert [path.name for path in zoo.glob("*.safetensors")] == ["mine.safetensors"]


def test_what_is_installed_is_known_by_what_it_needs(installed):
    said = installed.run("python -m pip check")
    assert "No broken requirements found" in said
    shown = installed.run("python -m pip show repaint-rl")
    assert "torch" in re.search(r"^Requires: (.*)$", shown, re.MULTILINE).group(1)
