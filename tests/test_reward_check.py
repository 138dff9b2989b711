"""`repaint tasks check` drives a reward function before training does."""

import re
from pathlib import Path

import numpy as np
import pytest

from repaint_cli.envs.racer.deepracer import reward_check
from repaint_cli.envs.racer.deepracer.reward_check import check_function
from repaint_cli.envs.racer.simulator import RacerSimulator
from repaint_cli.errors import CardError
from repaint_cli.files.paths import shipped
from repaint_cli.tasks.card_files import read_task

CASES = Path(__file__).parents[2] / "shared" / "data" / "deepracer" / "cases"
TRACKS = shipped("tasks") / "racer" / "tracks"
ENV = read_task("racer-inner").with_settings(["env.track=oval"]).env
STATES = {
    "off the road": "params['is_offtrack']",
    "with some wheels off": "not params['all_wheels_on_track'] and not params['is_offtrack']",
    "the other way": "params['is_reversed']",
    "this way": "not params['is_reversed']",
    "at the end of a lap": "params['progress'] >= 100",
    "at its end the other way": "params['progress'] >= 100 and params['is_reversed']",
    "backwards": "params['progress'] < 0 and params['steps'] > 3",
    "far off the middle": "params['distance_from_center'] > 0.6 * params['track_width']",
    "slowly to the left": "params['speed'] == 0.5 and params['steering_angle'] == 30",
    "across": "70 < abs((params['heading'] - toward(params) + 180) % 360 - 180) < 110",
}
ACROSS = """
import math


def toward(params):
    a, b = (params["waypoints"][i] for i in params["closest_waypoints"])
    return math.degrees(math.atan2(b[1] - a[1], b[0] - a[0]))


"""


@pytest.mark.parametrize("state", STATES.values(), ids=STATES)
def test_it_drives_all_ways(state):
    source = f"{ACROSS}def reward_function(params):\n    return 1 / (not ({state}))\n"
    (error,) = check_function(ENV, "mine.py", source).errors
    assert error.place == "mine.py:11: ZeroDivisionError: division by zero"


def test_half_of_the_cars_are_disturbed_and_none_is_told_so(monkeypatch):
    disturbed = []

    def disturb(command, noise, rng):
        disturbed.append(noise.action)
        return command * 0.9

    monkeypatch.setattr(reward_check, "disturb_command", disturb)
    monkeypatch.setattr(reward_check, "N_STEPS", 20)
    monkeypatch.setattr(reward_check, "LAP_STEPS", 20)
    listed = "{-30.0, -15.0, 0.0, 15.0, 30.0}"
    source = f"def reward_function(params):\n    return 1 / (params['steering_angle'] in {listed})"
    assert check_function(ENV, "mine.py", source).errors == []
    assert disturbed == [0.1] * (20 * 32)


@pytest.mark.parametrize(("waypoints", "n"), [("file", 102), ("unique", 101)])
def test_waypoints_are_numbered_as_the_card_says(tmp_path, monkeypatch, waypoints, n):
    monkeypatch.setattr(reward_check, "N_STEPS", 2)
    monkeypatch.setattr(reward_check, "LAP_STEPS", 2)
    rows = np.load(TRACKS / "oval.npy")
    np.save(tmp_path / "twice.npy", np.insert(rows, 5, rows[5], axis=0))
    env = RacerSimulator(simulator="racer", track=str(tmp_path / "twice.npy"), waypoints=waypoints)
    source = "def reward_function(params):\n    return len(params['waypoints'])\n"
    (note,) = check_function(env, "mine.py", source).notes
    assert note.startswith(f"mine.py pays {n} to {n} in ")


def card(home, source):
    (home / "mine.py").write_text(source)
    (home / "mine.toml").write_text(
        'extends = "racer-inner"\nsummary = "Mine."\n[env]\ntrack = "oval"\n'
        '[reward]\nfunction = "mine.py"\n'
    )
    return "mine.toml"


LATE = """def reward_function(params):
    wheels = 0 if params["is_offtrack"] else 4
    return 1.0 / wheels + 0 * params['progress']
"""


def test_a_line_that_fails_is_named_once_with_its_step_and_what_params_said(repaint, home):
    said = repaint("tasks", "check", card(home, LATE))
    assert said.code == CardError.exit_code
    (line,) = said.err.splitlines()
    assert line.startswith("error: mine.py:3: ZeroDivisionError: float division by zero (at step ")
    assert "is_offtrack = True, progress = " in line
    assert "waypoints" not in line


def test_all_ways_to_fail_are_named(repaint, home):
    source = """def reward_function(params):
    if params["is_offtrack"]:
        return params["wheels"]
    if params["progress"] >= 100:
        return "a lap"
    return 1
"""
    said = repaint("tasks", "check", card(home, source))
    first, second = said.err.splitlines()
    assert "mine.py:3: KeyError: 'wheels' (at step " in first
    assert "mine.py:1: expected a reward within ±100,000" in second
    assert "found 'a lap' (at step " in second
    assert "progress = 100" in second


def test_what_fails_in_every_step_is_said_once(repaint, home):
    said = repaint("tasks", "check", card(home, "def reward_function(params):\n    return None"))
    assert said.err.count("found None (at step 1 of environment 0)") == 1
    assert len(said.err.splitlines()) == 1


def test_it_says_what_is_paid_and_printed_and_how_long_it_takes(repaint, home):
    source = """def reward_function(params):
    print("step")
    return 2.5 if params["is_offtrack"] else -1 if params["progress"] >= 100 else 0.125
"""
    said = repaint("tasks", "check", card(home, source))
    assert said.code == 0
    line = said.out.splitlines()[-1]
    assert line.startswith("note: mine.py pays -1 to 2.5 in 1")
    assert re.search("which end [4-8] laps; 9[0-9]% of the steps are paid 0.125; a call", line)
    assert line.endswith("µs and prints 1 line a call")


def test_a_slow_function_is_no_long_check(monkeypatch):
    monkeypatch.setattr(reward_check, "SECONDS", 1.0)
    source = "import time\ndef reward_function(params):\n    time.sleep(0.003)\n    return 1\n"
    check = check_function(ENV, "mine.py", source)
    (took,) = re.findall(r"a call of mine\.py takes ([\d.]+) ms", check.warnings[-1])
    assert float(took) >= 3  # more on a busy machine
    assert "no car came to the end of a lap" in check.warnings[0]


def test_a_text_that_does_not_run_is_said_once(repaint, home):
    said = repaint("tasks", "check", card(home, "import nothing_of_this_name"))
    assert said.err.count("ModuleNotFoundError") == 1
    assert len(said.err.splitlines()) == 1


@pytest.mark.skipif(not CASES.is_dir(), reason="the cases of DeepRacer users are not here")
@pytest.mark.parametrize(
    ("case", "code", "word"),
    [
        ("late", 3, "late.py:4: ZeroDivisionError: float division by zero (at step "),
        ("marked", 0, "marked is sound"),
        ("speed_table", 0, "speed_table is sound"),
        ("beyond", 0, "-45° becomes -30° in action 0, 6 m/s becomes 4 m/s in action 1"),
        ("second", 0, "second.py remembers, as its variables change: seen; they last as long as"),
        ("talks", 0, "prints 1 line a call"),
    ],
)
def test_the_cases_of_users(repaint, case, code, word):
    said = repaint("tasks", "check", CASES / f"{case}.toml")
    assert said.code == code
    assert word in said.out + said.err
