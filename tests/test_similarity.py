"""How alike two tasks are: the cosine of their weights and the paper's verdict."""

import json
import subprocess
import sys
from shutil import copyfile

import pytest

from repaint_cli.files.paths import shipped_tasks
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.card_files import read_task
from repaint_cli.tasks.similarity import cosine, relation
from repaint_cli.zoo.store import teachers

ANT = ("forward", "survive", "ctrl", "contact")
MULTI_CAR = ("keep", "clear", "hazard", "camlane", "dprog", "fail")


def card(name, terms, *weights, env_id="Ant-v5"):
    """A card of some environment; cosines need none to exist."""
    env = {"simulator": "gymnasium", "id": env_id}
    reward = dict(zip(terms, weights, strict=True))
    return TaskCard.parse({"name": name, "summary": "", "env": env, "reward": reward}, "a test")


AVOID = card("avoid", MULTI_CAR, 0, 4, -4, 0, 0, 0)
ADVANCED = card("advanced", MULTI_CAR, 1, 4, -4, -2, 0, 0)
PROGRESS = card("progress", MULTI_CAR, 0, 0, 0, 0, 10, -5)


@pytest.mark.parametrize(
    ("teacher", "target", "expected", "verdict"),
    [
        ("racer-inner", "racer-outer", -1, "different"),
        ("reacher-gentle", "reacher", 4 / (10 * 2) ** 0.5, "similar"),  # 0.894
        ("reacher-away", "reacher", 0, "different"),
    ],
)
def test_shipped_pairs(teacher, target, expected, verdict):
    one, other = read_task(teacher), read_task(target)
    assert cosine(one, other) == cosine(other, one) == pytest.approx(expected)
    assert relation(one, other) == verdict


@pytest.mark.parametrize(("forward", "expected"), [(3, 0.866), (5, 0.756), (10, 0.640)])
def test_the_papers_ants(forward, expected):
    ant, fast = card("ant", ANT, 1, 1, 1, 1), card("fast", ANT, forward, 1, 1, 1)
    assert cosine(fast, ant) == pytest.approx(expected, abs=5e-4)
    assert relation(fast, ant) == "similar"


def test_being_a_sub_task_has_a_direction():
    assert cosine(AVOID, ADVANCED) == pytest.approx(0.930, abs=5e-4)
    assert relation(AVOID, ADVANCED) == "similar, sub-task"
    assert relation(ADVANCED, AVOID) == "similar"
    assert cosine(AVOID, PROGRESS) == 0
    assert relation(AVOID, PROGRESS) == "different, sub-task"


def test_the_order_of_terms_does_not_matter():
    turned = card("turned", ANT[::-1], 1, 1, 1, 3)
    assert cosine(turned, card("fast", ANT, 3, 1, 1, 1)) == pytest.approx(1)


@pytest.mark.parametrize(
    "other",
    [
        card("other env", ANT, 1, 1, 1, 1, env_id="Humanoid-v5"),
        card("fewer terms", ANT[:3], 1, 1, 1),
        read_task("racer-inner"),
    ],
    ids=lambda other: other.name,
)
def test_other_environments_or_terms_are_not_comparable(other):
    ant = card("ant", ANT, 1, 1, 1, 1)
    assert cosine(ant, other) is cosine(other, ant) is None
    assert relation(ant, other) == "not comparable"


def test_two_names_give_a_line(repaint):
    said = repaint("similarity", "racer-inner", "racer-outer")
    assert said.out.splitlines()[0] == "racer-inner → racer-outer  -1.000  different"
    said = repaint("similarity", "racer-inner", "reacher")
    assert (
        said.out == "racer-inner → reacher  not comparable: other simulators: racer and gymnasium\n"
    )


def test_no_name_gives_a_matrix_of_all_shipped_tasks(repaint):
    said = repaint("similarity")
    for name in shipped_tasks():
        row = next(line for line in said.out.splitlines() if line.startswith(f" {name} "))
        assert "1.000" in row
    assert "0.894" in said.out


def test_json_is_for_scripts(repaint):
    (pair,) = json.loads(repaint("similarity", "reacher-gentle", "reacher", "--json").out)
    assert pair.pop("cosine") == pytest.approx(0.894, abs=5e-4)
    expected = {
        "teacher": "reacher-gentle",
        "target": "reacher",
        "relation": "similar",
        "reason": None,
        "views": {},
        "view": None,
    }
    assert pair == expected
    names = ("reacher-gentle", "reacher", "racer-inner")
    pairs = json.loads(repaint("similarity", *names, "--json").out)
    assert len(pairs) == 6
    assert sum(pair["cosine"] is None for pair in pairs) == 4


def test_a_teacher_stands_for_its_task_and_a_card_for_itself(repaint, home):
    (home / "home" / "zoo").mkdir(parents=True)
    copyfile(teachers()["reacher-gentle"], home / "home" / "zoo" / "old-hand.safetensors")
    repaint("tasks", "copy", "reacher", "mine.toml")
    assert "0.894" in repaint("similarity", "old-hand", "mine.toml").out


@pytest.mark.parametrize(
    "command",
    [["--help"], ["similarity"], ["tasks", "list"], ["tasks", "show", "reacher"], ["zoo", "list"]],
)
def test_quick_commands_import_no_torch(command):
    code = f"""
import sys
from repaint_cli.cli.app import main
sys.argv = ["repaint", *{command}]
try:
    main()
except SystemExit as end:
    assert not end.code, end.code
loaded = {{"torch", "numba", "mujoco", "gymnasium", "matplotlib", "numpy"}} & set(sys.modules)
assert not loaded, loaded
"""
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
