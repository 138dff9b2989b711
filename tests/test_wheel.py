"""What is installed: code and data, from any folder."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

LOOK = """
from repaint_cli.files import paths
from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.report.html import FOLDER
from repaint_cli.tasks.card_files import shipped_tasks
from repaint_cli.zoo.store import teachers
assert "site" in str(paths.PACKAGE), paths.PACKAGE
assert {"page.html", "page.css", "page.js"} <= {path.name for path in FOLDER.iterdir()}
print(*shipped_tasks())
print(*teachers())
print(load_track("oval").name)
"""


@pytest.mark.slow
def test_the_wheel_brings_tasks_tracks_and_zoo_and_no_code_among_them(tmp_path):
    def pip(*words):
        command = [sys.executable, "-m", "pip", *map(str, words), "--no-deps", "--quiet"]
        subprocess.run(command, check=True, capture_output=True)

    pip("wheel", ROOT, "--wheel-dir", tmp_path)
    (wheel,) = tmp_path.glob("*.whl")
    site = tmp_path / "site"
    pip("install", wheel, "--target", site)

    assert {path.name for path in site.iterdir() if path.suffix != ".dist-info"} <= {
        "repaint_cli", "bin"
    }  # fmt: skip
    data = site / "repaint_cli" / "_data"
    assert not list(data.rglob("*.py"))
    for kind in ("tasks", "zoo"):
        beside = {path.relative_to(ROOT / kind) for path in (ROOT / kind).rglob("*.*")}
        assert {path.relative_to(data / kind) for path in (data / kind).rglob("*.*")} == beside

    env = os.environ | {"PYTHONPATH": str(site), "REPAINT_HOME": str(tmp_path / "home")}
    look = [sys.executable, "-c", LOOK]
    said = subprocess.run(
        look, cwd=tmp_path, env=env, check=True, stdout=subprocess.PIPE, text=True
    )
    tasks, teachers, track = said.stdout.splitlines()
    assert set(tasks.split()) == {path.stem for path in (ROOT / "tasks").rglob("*.toml")}
    assert set(teachers.split()) == {path.stem for path in (ROOT / "zoo").glob("*.safetensors")}
    assert track == "oval"
