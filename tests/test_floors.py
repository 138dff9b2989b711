"""The house has floors: a package imports only from those that the table names."""

import ast

import pytest

from repaint_cli.files.paths import PACKAGE

MAY_IMPORT = {
    "ground": "",
    "files": "ground",
    "report": "ground files",
    "envs": "ground files report",
    "policies": "ground files",
    "tasks": "ground files envs policies",
    "learn": "ground envs tasks policies",
    "zoo": "ground files report tasks policies learn",
    "runs": "ground files report envs tasks policies learn zoo",
    "engines": "ground files tasks zoo runs",
    "experiments": "ground files report tasks learn zoo runs engines",
    "cli": "ground files report envs tasks policies learn zoo runs engines experiments door",
    "door": "ground envs tasks policies learn zoo runs engines cli",
}
"""Packages, the single files beside them (ground), and what users import and run (door)."""

DOOR = {"__init__", "__main__"}

WITHOUT_TORCH = {"files", "report", "envs", "tasks", "cli"}
"""So that `repaint --help` and `repaint similarity` are quick."""

WITHOUT_FILES = {"learn"}
"""The paper: given arrays, environments and networks, it yields what happened."""


def package_of(path):
    """The row of the table that a file belongs to."""
    first, *rest = path.relative_to(PACKAGE).with_suffix("").parts
    if rest:
        return first
    return "door" if first in DOOR else "ground"


def imports_of(source):
    """The packages of ours, and the libraries, that a text imports, wherever it does."""
    ours, libraries = set(), set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        for name in names:
            library, _, rest = name.partition(".")
            if library != "repaint_cli":
                libraries.add(library)
                continue
            first = rest.partition(".")[0]
            if first and (PACKAGE / first).is_dir():
                ours.add(first)
            elif first == "__version__" or (PACKAGE / f"{first}.py").is_file():
                ours.add("ground")
            else:
                ours.add("door")
    return ours, libraries


FILES = {str(path.relative_to(PACKAGE)): path for path in PACKAGE.rglob("*.py")}


def wrong_in(home, source):
    """What a file of a package imports and may not."""
    ours, libraries = imports_of(source)
    wrong = ours - {home, *MAY_IMPORT[home].split()}
    if home in WITHOUT_TORCH:
        wrong |= libraries & {"torch"}
    if home in WITHOUT_FILES:
        wrong |= libraries & {"pathlib"}
    return wrong


@pytest.mark.parametrize("name", sorted(FILES))
def test_a_file_imports_only_what_its_package_may(name):
    path = FILES[name]
    assert not wrong_in(package_of(path), path.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("home", "line", "wrong"),
    [
        ("learn", "from repaint_cli.runs.reader import read_run", "runs"),
        ("learn", "from pathlib import Path", "pathlib"),
        ("envs", "def f():\n    from repaint_cli.tasks import trust", "tasks"),
        ("report", "from repaint_cli.envs.racer.road import draw_road", "envs"),
        ("tasks", "import torch", "torch"),
        ("ground", "from repaint_cli.files.atomic import write_text", "files"),
    ],
)
def test_who_breaks_the_table_is_found(home, line, wrong):
    assert wrong_in(home, line) == {wrong}


def test_every_package_is_in_the_table_and_the_ground_is_small():
    packages = {package_of(path) for path in FILES.values()}
    assert packages == set(MAY_IMPORT)
    assert [package_of(path) for path in FILES.values()].count("ground") <= 8


def test_files_are_short():
    long = [name for name, path in FILES.items() if len(path.read_text().splitlines()) > 250]
    assert not long
