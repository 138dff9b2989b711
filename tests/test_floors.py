"""The house has floors: a module imports only from lower ones, or from its own package."""

import ast
from itertools import pairwise

import pytest

from repaint_cli.paths import PACKAGE

FLOORS = [
    {"repaint_cli", "errors", "paths", "config", "kernels", "presets"},
    {
        "architecture",
        "reading",
        "envs",
        "distributions",
        "methods",
        "normalizer",
        "spaces",
        "report.statistics",
    },
    {"simulators", "deepracer", "files"},
    {"tasks", "nets"},
    {"cards", "learn", "similarity", "reward_fit", "provenance"},
    {"evaluate", "checkpoint", "history", "teacher_card"},
    {"zoo", "metrics", "traces", "evaluations", "snapshot", "trust"},
    {"simtrace", "plans", "model_card"},
    {"teaching", "alarms", "measuring", "export"},
    {"past"},
    {"runs"},
    {"report", "foreign", "verify"},
    {"cli"},
    {"__main__"},
]
"""From the cellar up: packages, or modules that live on another floor than their package."""

KNOW_TORCH = {
    "distributions",
    "normalizer",
    "nets",
    "learn",
    "checkpoint",
    "evaluations",
    "export",
    "provenance",
    "snapshot",
    "teaching",
    "runs",
    "report",
    "foreign",
}
"""All others leave it out, so that `repaint --help` and `repaint similarity` are quick."""

KNOW_NO_FILES = {"envs", "learn", "distributions", "normalizer", "nets", "report.statistics"}

MODULES = {
    ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__"): path
    for path in PACKAGE.rglob("*.py")
    if "_data" not in path.parts
}
MODULES["repaint_cli"] = MODULES.pop("__init__")


def home_of(module):
    """The entry of FLOORS that a module belongs to, and its floor."""
    for name in (module, module.partition(".")[0]):
        for floor, homes in enumerate(FLOORS):
            if name in homes:
                return name, floor
    raise AssertionError(f"{module} has no floor: add it to FLOORS")


def imports_of(path):
    """The modules of ours, and the libraries, that a file imports, wherever in the file."""
    ours, libraries = set(), set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        for name in names:
            package, _, rest = name.partition(".")
            if package != "repaint_cli":
                libraries.add(package)
                continue
            parent = rest.rpartition(".")[0] or "repaint_cli"
            ours.add(rest if rest in MODULES else parent)
    return ours, libraries


@pytest.mark.parametrize("module", sorted(MODULES))
def test_a_module_imports_only_from_below(module):
    home, floor = home_of(module)
    for other in imports_of(MODULES[module])[0]:
        other_home, other_floor = home_of(other)
        assert other_home == home or other_floor < floor, f"{module} imports {other}"


@pytest.mark.parametrize("module", sorted(MODULES))
def test_a_module_knows_only_what_its_trade_needs(module):
    home, _ = home_of(module)
    ours, libraries = imports_of(MODULES[module])
    assert "torch" not in libraries or home in KNOW_TORCH, module
    if home in KNOW_NO_FILES:
        assert not ours & {"paths", "files"}
        assert "pathlib" not in libraries


def test_every_entry_is_there_once():
    entries = [entry for floor in FLOORS for entry in floor]
    assert len(entries) == len(set(entries))
    packages = {module.partition(".")[0] for module in MODULES}
    assert {entry.partition(".")[0] for entry in entries} == packages
    assert all(not lower & upper for lower, upper in pairwise(FLOORS))
