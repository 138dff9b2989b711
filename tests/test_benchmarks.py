"""The benchmarks measure in turns, and the page about speed shows what they measured."""

import re
from importlib import import_module
from pathlib import Path

import beside_sb3
import numpy as np
import precision
import pytest
import turns

ROOT = Path(__file__).parents[1]
NAMES = (
    "training_mujoco",
    "training_racer",
    "training_starcraft",
    "startup",
    "scaling",
    "simulators",
    "starcraft",
    "pieces",
    "records",
    "crowded",
)
SPEED = (ROOT / "docs" / "speed.md").read_text(encoding="utf-8")

SCRIPT = """
import sys
from pathlib import Path
import turns

def measure(side):
    log = Path(__file__).with_suffix(".log")
    log.write_text(log.read_text() + side if log.exists() else side)
    if side == "z":
        raise RuntimeError("no such thing")
    return float(ord(side))

def tables(found):
    yield turns.Table(("side", "number"), [(s, turns.span(n, ".0f")) for s, n in found.items()])

turns.run(__file__, "A test.", {s: (lambda s=s: measure(s)) for s in SIDES}, tables)
"""


@pytest.fixture
def script(tmp_path, monkeypatch):
    """A benchmark of the sides that are named, and the log of which were measured when."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT / "benchmarks"))

    def write(*sides):
        path = tmp_path / "bench.py"
        path.write_text(SCRIPT.replace("SIDES", repr(sides)), encoding="utf-8")
        return path, path.with_suffix(".log")

    return write


def test_sides_take_turns(script):
    path, log = script("a", "b")
    found = turns.in_turns(str(path), ["a", "b"], 3)
    assert log.read_text() == "ababab"
    assert {side: numbers.tolist() for side, numbers in found.items()} == {
        "a": [97.0] * 3,
        "b": [98.0] * 3,
    }


def test_a_side_that_fails_ends_the_benchmark_with_its_reason(script):
    path, log = script("a", "z")
    with pytest.raises(SystemExit, match=r"(?s)z:.*no such thing"):
        turns.in_turns(str(path), ["a", "z", "a"], 2)
    assert log.read_text() == "az"


def test_what_was_kept_is_what_was_found(tmp_path, monkeypatch):
    monkeypatch.setattr(turns, "RESULTS", tmp_path)
    found = {"one, two": np.array([1.5, 2.25]), "three": np.array([1234567.0, 1e-3])}
    turns.keep(found, "some/where.py")
    kept = turns.kept("some/where.py")
    assert kept.keys() == found.keys()
    for side, numbers in found.items():
        np.testing.assert_allclose(kept[side], numbers, rtol=1e-5)


def test_a_span_is_the_median_and_the_range():
    assert turns.span(np.array([3.0, 1.0, 10.0]), ".1f") == "3.0 [1.0, 10.0]"


@pytest.mark.parametrize("name", NAMES)
def test_the_tables_are_those_that_were_measured(name):
    benchmark = import_module(name)
    found = turns.kept(benchmark.__file__)
    assert found.keys() == benchmark.SIDES.keys()
    for table in benchmark.tables(found):
        for line in turns.markdown(table):
            assert line in SPEED


def test_the_table_beside_sb3_is_what_was_measured():
    results = (ROOT / "docs/results.md").read_text(encoding="utf-8")
    lines = list(turns.markdown(beside_sb3.table()))
    assert len(lines) > 5
    for line in lines:
        assert line in results


def test_the_table_of_precisions_is_what_was_measured():
    lines = list(turns.markdown(precision.table()))
    assert len(lines) > 4
    for line in lines:
        assert line in SPEED


def test_the_readmes_tables_are_lines_of_that_page():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    section = readme.partition("**Speed**")[2].partition("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")]
    assert len(lines) > 5
    for line in lines:
        assert line in SPEED


def test_make_bench_runs_them_all():
    line = re.search(r"^BENCHMARKS := (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert tuple(line.group(1).split()) == NAMES
